"""Describes a scene's keys in words: type, unit, range and meaning of a value."""

from __future__ import annotations

import ast
import inspect
import textwrap
import typing
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from itertools import pairwise
from types import NoneType
from typing import Any

from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.scene.toml_keys import Path
from hapticlink.orchestrator.scene.types_of_keys import (
    annotations_at,
    as_written,
    find_quantities,
    types_at,
)

_COUNTS = ("no", "one", "two", "three", "four", "five", "six")


def vector(path: Path, data: Any) -> str:
    """The array that may be at `path` in words, `three numbers (N/m, N/m, N.m/rad)`; "" where no
    array may be."""
    arrays = [k for k in types_at(path, data) if typing.get_origin(k) is tuple]
    return " or ".join(dict.fromkeys(words(k) + _beside(unit(k)) for k in arrays))


def describe_expected(path: Path, data: Any) -> str:
    """What the value at `path` may be, in words."""
    kinds = [pair for kind in annotations_at(path, data) for pair in find_quantities(kind)]
    return _in_words(kinds, lambda kind, q: _beside(q.unit if q else unit(kind)))


def number(path: Path, data: Any) -> str:
    """The number that may be at `path` with its range and unit, `number > 0 (kg)`."""
    kinds = [pair for hint in annotations_at(path, data) for pair in find_quantities(hint)]
    plain = Quantity("1")  # for a part of a registry that declares no quantity
    numbers = [(kind, quantity or plain) for kind, quantity in kinds if kind in (float, int)]
    word = "whole number" if all(kind is int for kind, _ in numbers) else "number"
    quantity = numbers[0][1]
    bounds = "" if quantity.range == "finite" else f" {quantity.range}"
    return word + bounds + _beside(quantity.unit)


def _beside(unit: str) -> str:
    return f" ({unit})" if unit not in ("", "1") else ""


def words(kind: Any) -> str:
    """The type of a value in words: `a number`, `three numbers`, `"a" or "b"`, `a table`."""
    return _in_words(find_quantities(kind), lambda kind, q: "")


def _in_words(
    kinds: Iterable[tuple[Any, Quantity | None]], beside: Callable[[Any, Quantity | None], str]
) -> str:
    found = {_word(kind, quantity): beside(kind, quantity) for kind, quantity in kinds}
    if "a number" in found:
        found.pop("a whole number", None)
    return _either([word + text for word, text in found.items() if word])


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
    if typing.get_origin(entries[0]) is typing.Literal:
        return f"{many} {inner}"
    if any(typing.get_origin(branch) is tuple for branch, _ in find_quantities(entries[0])):
        return f"{many} rows of {inner}"
    return f"{many} " + {"a table": "tables", "a text": "texts"}.get(inner, "numbers")


def _either(words: list[str]) -> str:
    return " or ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)


def unit(kind: Any) -> str:
    """The unit of a value's numbers, entry by entry where they differ; "" where they have none."""
    return _of_numbers(kind, lambda quantity: "" if quantity.unit == "1" else quantity.unit)


def limits(kind: Any) -> str:
    """The range of a value's numbers, entry by entry where they differ; "" where it has none."""
    return _of_numbers(kind, lambda quantity: quantity.range)


def _of_numbers(kind: Any, what: Callable[[Quantity], str]) -> str:
    texts = []
    for branch, quantity in find_quantities(kind):
        if quantity:
            texts.append(what(quantity))
        elif typing.get_origin(branch) in (tuple, Mapping):
            entries = [_of_numbers(entry, what) for entry in typing.get_args(branch)]
            entries = [text for text in entries if text]
            texts.append(entries[0] if len({*entries}) == 1 else ", ".join(entries))
    return "; ".join(text for text in dict.fromkeys(texts) if text)


@cache
def meanings(record: Any) -> dict[str, str]:
    """The meaning of each key of a record, from the docstrings under its fields."""
    texts = {}
    for kind in reversed(as_written(record).__mro__[:-1]):
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
        for field, text in pairwise(typing.cast("ast.ClassDef", body).body):
            if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
                name = typing.cast("ast.Name", field.target).id.rstrip("_")
                texts[name] = " ".join(ast.literal_eval(text.value).split())
    return texts


def about(record: Any) -> str:
    """The meaning of a record's table, from its docstring."""
    return inspect.cleandoc(as_written(record).__doc__ or "")
