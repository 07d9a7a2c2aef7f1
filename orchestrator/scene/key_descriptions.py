"""A scene's keys in words: what a value is, its unit, its range, its meaning."""

from __future__ import annotations

import ast
import inspect
import textwrap
import typing
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise
from types import NoneType
from typing import Any

from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.scene.schema import at, measured, said_of
from hapticlink.orchestrator.scene.toml_keys import Path

_COUNTS = ("no", "one", "two", "three", "four")


def vector(path: Path) -> str:
    """`three numbers (N/m, N/m, N.m/rad)`: the array at `path`, "" where there is none."""
    arrays = [k for k in at(path) if typing.get_origin(k) is tuple]
    return " or ".join(dict.fromkeys(words(k) + _beside(unit(k)) for k in arrays))


def expected(path: Path) -> str:
    """What may stand at `path`, in words."""
    found = [pair for kind in said_of(path) for pair in measured(kind)]
    told = {_word(k, q): _beside(q.unit if q else unit(k)) for k, q in found}
    if "a number" in told:
        told.pop("a whole number", None)
    return " or ".join(word + unit for word, unit in told.items() if word)


def number(path: Path) -> str:
    """`number > 0 (kg)`: the number that may stand at `path`, with its range and unit."""
    found = [(k, q) for kind in said_of(path) for k, q in measured(kind) if k in (float, int) and q]
    word = "whole number" if all(kind is int for kind, _ in found) else "number"
    quantity = found[0][1]
    bounds = "" if quantity.range == "finite" else f" {quantity.range}"
    return word + bounds + _beside(quantity.unit)


def _beside(unit: str) -> str:
    return f" ({unit})" if unit not in ("", "1") else ""


def words(kind: Any) -> str:
    """What a value is: `a number`, `three numbers`, `"a" or "b"`, `a table`."""
    found = [_word(branch, quantity) for branch, quantity in measured(kind)]
    if "a number" in found:
        found = [word for word in found if word != "a whole number"]
    return " or ".join(word for word in dict.fromkeys(found) if word)


_WORDS = {
    float: "a number",
    int: "a whole number",
    str: "a text",
    bool: "true or false",
    NoneType: "",
}


def _word(kind: Any, quantity: Quantity | None) -> str:
    if typing.get_origin(kind) is typing.Literal:
        return " or ".join("false" if v is False else f'"{v}"' for v in typing.get_args(kind))
    if typing.get_origin(kind) is not tuple:
        fraction = kind is str and quantity
        return 'a fraction as text ("1/30")' if fraction else _WORDS.get(kind, "a table")
    entries = typing.get_args(kind)
    many = "a list of" if Ellipsis in entries else _COUNTS[len(entries)]
    inner = words(entries[0])
    if typing.get_origin(entries[0]) is tuple:
        return f"{many} rows of {inner}"
    return f"{many} " + {"a table": "tables", "a text": "texts"}.get(inner, "numbers")


def unit(kind: Any) -> str:
    """The unit of the numbers of a value, entry by entry where they differ; "" for none."""
    return "; ".join(dict.fromkeys(u for u in _of_numbers(kind, "unit") if u != "1"))


def limits(kind: Any) -> str:
    """The range of the numbers of a value, entry by entry where they differ; "" without any."""
    return "; ".join(dict.fromkeys(_of_numbers(kind, "range")))


def _of_numbers(kind: Any, what: str) -> Iterator[str]:
    for branch, quantity in measured(kind):
        if quantity:
            yield getattr(quantity, what)
        elif typing.get_origin(branch) in (tuple, Mapping):
            entries = [a for a in typing.get_args(branch) if a not in (Ellipsis, str)]
            texts = [text for entry in entries if (text := "; ".join(dict.fromkeys(_of_numbers(entry, what))))]
            if texts:
                yield texts[0] if len(set(texts)) == 1 else ", ".join(texts)


@cache
def meanings(record: Any) -> dict[str, str]:
    """The meaning of each key of a record: the docstring under its field."""
    found = {}
    for kind in reversed(record.__mro__[:-1]):
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
        for field, text in pairwise(typing.cast("ast.ClassDef", body).body):
            if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
                name = typing.cast("ast.Name", field.target).id.rstrip("_")
                said = ast.literal_eval(text.value)
                found[name] = " ".join(said.split())
    return found
