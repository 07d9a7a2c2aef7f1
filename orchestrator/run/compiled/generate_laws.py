"""Writes the laws of the holds (holds/laws_of_holds.py) in C: each is evaluated once on
symbols, which note the operations. It needs the standard library only, since the build of the
package runs it, too."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

LAWS = Path(__file__).parents[2] / "holds" / "laws_of_holds.py"
VECTORS = ("y", "y1", "y2", "w", "wd")
"""Arguments of a law with an entry k for each of the signal; the others are numbers."""
BESIDE = {"yd": "y[n + k]", "yd1": "y1[n + k]"}


class Symbol:
    """An expression in C. Every operation is in brackets, so that C keeps the order of Python."""

    def __init__(self, text: str) -> None:
        self.text = text

    def _joined(self, operator: str, other: Symbol | float, swapped: bool = False) -> Symbol:
        right = other.text if isinstance(other, Symbol) else repr(float(other))
        first, second = (right, self.text) if swapped else (self.text, right)
        return Symbol(f"({first} {operator} {second})")

    def __add__(self, other: Symbol | float) -> Symbol:
        return self._joined("+", other)

    def __radd__(self, other: float) -> Symbol:
        return self._joined("+", other, swapped=True)

    def __sub__(self, other: Symbol | float) -> Symbol:
        return self._joined("-", other)

    def __rsub__(self, other: float) -> Symbol:
        return self._joined("-", other, swapped=True)

    def __mul__(self, other: Symbol | float) -> Symbol:
        return self._joined("*", other)

    def __rmul__(self, other: float) -> Symbol:
        return self._joined("*", other, swapped=True)

    def __truediv__(self, other: Symbol | float) -> Symbol:
        return self._joined("/", other)


def _symbol(name: str) -> Symbol:
    return Symbol(BESIDE.get(name, f"{name}[k]" if name in VECTORS else name))


def text() -> str:
    """The cases of `switch (LAW(kind, i))` in holds.c, one for each law i of a kind."""
    module: dict[str, Any] = runpy.run_path(str(LAWS))
    cases = [
        f"case LAW({kind}, {i}):\n"
        f"    for (int64_t k = 0; k < n; k++) value[k] = {value.text};\n"
        "    return;\n"
        for kind, laws in module["LAWS"].items()
        for i, law in enumerate(laws)
        for value in [law(*map(_symbol, module["arguments"](law)))]
    ]
    return "".join(cases)
