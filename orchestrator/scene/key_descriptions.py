"""A scene's keys in words: what a value is, its unit, its range, its meaning."""

from __future__ import annotations

import ast
import inspect
import textwrap
import typing
from collections.abc import Callable, Mapping
from functools import cache
from itertools import pairwise
from types import NoneType
from typing import Any

from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.scene.schema import as_written, at, measured, said_of
from hapticlink.orchestrator.scene.toml_keys import Path

_COUNTS = ("no", "one", "two", "three", "four")


def vector(path: Path, data: Any) -> str:
    """`three numbers (N/m, N/m, N.m/rad)`: the array at `path`, "" where there is none."""
    arrays = [k for k in at(path, data) if typing.get_origin(k) is tuple]
    return " or ".join(dict.fromkeys(words(k) + _beside(unit(k)) for k in arrays))


def expected(path: Path, data: Any) -> str:
    """What may stand at `path`, in words."""
    found = [pair for kind in said_of(path, data) for pair in measured(kind)]
    told = {_word(k, q): _beside(q.unit if q else unit(k)) for k, q in found}
    if "a number" in told:
        told.pop("a whole number", None)
    return _either([word + unit for word, unit in told.items() if word])


def number(path: Path, data: Any) -> str:
    """`number > 0 (kg)`: the number that may stand at `path`, with its range and unit."""
    kinds = [pair for hint in said_of(path, data) for pair in measured(hint)]
    plain = Quantity("1")  # of a part that says no more
    numbers = [(kind, quantity or plain) for kind, quantity in kinds if kind in (float, int)]
    word = "whole number" if all(kind is int for kind, _ in numbers) else "number"
    quantity = numbers[0][1]
    bounds = "" if quantity.range == "finite" else f" {quantity.range}"
    return word + bounds + _beside(quantity.unit)


def _beside(unit: str) -> str:
    return f" ({unit})" if unit not in ("", "1") else ""


def words(kind: Any) -> str:
    """What a value is: `a number`, `three numbers`, `"a" or "b"`, `a table`."""
    found = [_word(branch, quantity) for branch, quantity in measured(kind)]
    if "a number" in found:
        found = [word for word in found if word != "a whole number"]
    return _either([word for word in dict.fromkeys(found) if word])


_WORDS = {
    float: "a number",
    int: "a whole number",
    str: "a text",
    bool: "true or false",
    NoneType: "",
}


def _word(kind: Any, quantity: Quantity | None) -> str:
    if typing.get_origin(kind) is typing.Literal:
        return _either(["false" if v is False else f'"{v}"' for v in typing.get_args(kind)])
    if typing.get_origin(kind) is not tuple:
        fraction = kind is str and quantity
        return 'a fraction as text ("1/30")' if fraction else _WORDS.get(kind, "a table")
    entries = typing.get_args(kind)
    many = "a list of" if Ellipsis in entries else _COUNTS[len(entries)]
    inner = words(entries[0])
    if typing.get_origin(entries[0]) is tuple:
        return f"{many} rows of {inner}"
    return f"{many} " + {"a table": "tables", "a text": "texts"}.get(inner, "numbers")


def _either(words: list[str]) -> str:
    return " or ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)


def unit(kind: Any) -> str:
    """The unit of the numbers of a value, entry by entry where they differ; "" for none."""
    return _of_numbers(kind, lambda quantity: "" if quantity.unit == "1" else quantity.unit)


def limits(kind: Any) -> str:
    """The range of the numbers of a value, entry by entry where they differ; "" without any."""
    return _of_numbers(kind, lambda quantity: quantity.range)


def _of_numbers(kind: Any, what: Callable[[Quantity], str]) -> str:
    found = []
    for branch, quantity in measured(kind):
        if quantity:
            found.append(what(quantity))
        elif typing.get_origin(branch) in (tuple, Mapping):
            entries = [_of_numbers(entry, what) for entry in typing.get_args(branch)]
            entries = [text for text in entries if text]
            found.append(entries[0] if len({*entries}) == 1 else ", ".join(entries))
    return "; ".join(text for text in dict.fromkeys(found) if text)


@cache
def meanings(record: Any) -> dict[str, str]:
    """The meaning of each key of a record: the docstring under its field."""
    found = {}
    for kind in reversed(as_written(record).__mro__[:-1]):
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
        for field, text in pairwise(typing.cast("ast.ClassDef", body).body):
            if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
                name = typing.cast("ast.Name", field.target).id.rstrip("_")
                said = ast.literal_eval(text.value)
                found[name] = " ".join(said.split())
    return found


def about(record: Any) -> str:
    """What a record says of its table."""
    return inspect.cleandoc(as_written(record).__doc__ or "")
