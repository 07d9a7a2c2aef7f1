"""What a scene's keys may hold, read off the annotations of its records: types, units, defaults."""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from types import UnionType
from typing import Any

from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path

_NUMBERS = ("no", "one", "two", "three", "four")


def keys(kinds: list[Any]) -> set[str]:
    """The keys of the records among `kinds`."""
    return {f.name.rstrip("_") for kind in _records(kinds) for f in fields(kind)}  # `from_`


def types(kind: Any) -> tuple[str, ...]:
    """The values of `type` that a record stands for, its default first; none without the key."""
    return typing.get_args(_hints(kind)["type"]) if "type" in keys([kind]) else ()


def chosen(kinds: list[Any], table: Any) -> list[Any]:
    """The records among `kinds` that `table` names by its `type`; all where it names none."""
    name = table.get("type") if isinstance(table, dict) else None
    return [k for k in _records(kinds) if name in types(k)] or kinds


def at(path: Path) -> list[Any]:
    """The types that the value at `path` may have, unions and annotations taken apart."""
    return [branch for kind in said_of(path) for branch in branches(kind)]


def said_of(path: Path) -> list[Any]:
    """What the records say of the value at `path`."""
    if not path:
        return [Scene]
    above, part = at(path[:-1]), path[-1]
    if isinstance(part, int):
        entries = [a for k in above if typing.get_origin(k) is tuple for a in typing.get_args(k)]
        return [a for a in dict.fromkeys(entries) if a is not Ellipsis]
    named = [typing.get_args(k)[1] for k in above if typing.get_origin(k) is Mapping]
    return named + [hint for kind in _records(above) if (hint := _hints(kind).get(part))]


def branches(kind: Any) -> list[Any]:
    """The members of a union, annotations taken off."""
    origin = typing.get_origin(kind)
    if origin is typing.Annotated:
        return branches(typing.get_args(kind)[0])
    if origin in (typing.Union, UnionType):
        return [branch for member in typing.get_args(kind) for branch in branches(member)]
    return [kind]


def is_needed(path: Path, of: Any = None) -> bool:
    """Whether the key at `path` has no default, in the record `of` or in any."""
    return any(
        f.name.rstrip("_") == path[-1] and f.default is MISSING and f.default_factory is MISSING
        for kind in ([of] if of else _records(at(path[:-1])))
        for f in fields(kind)
    )


def vector(path: Path) -> str:
    """`three numbers (N/m, N/m, N.m/rad)`: what an array at `path` holds, "" where there is
    none."""
    found = [_vector(branch, unit) for kind in said_of(path) for branch, unit in _units(kind)]
    return " or ".join(dict.fromkeys(s for s in found if s))


def _vector(kind: Any, unit: str) -> str:
    entries = typing.get_args(kind) if typing.get_origin(kind) is tuple else ()
    if not entries:
        return ""
    count = None if Ellipsis in entries else len(entries)
    many = "a list of " if count is None else f"{_NUMBERS[count]} "
    inner = _vector(entries[0], "")
    if inner:
        what = f"{many}rows of {inner}"
    elif is_dataclass(entries[0]):
        what = f"{many}tables"
    else:
        what = many + ("texts" if entries[0] is str else "numbers")
    return f"{what} ({unit})" if unit else what


def _units(kind: Any, unit: str = "") -> list[tuple[Any, str]]:
    """The branches of an annotation, each with the unit that stands beside it."""
    if typing.get_origin(kind) is typing.Annotated:
        inner, *beside = typing.get_args(kind)
        return _units(inner, next((b for b in beside if isinstance(b, str)), unit))
    if typing.get_origin(kind) in (typing.Union, UnionType):
        return [pair for member in typing.get_args(kind) for pair in _units(member, unit)]
    return [(kind, unit)]


def _records(kinds: list[Any]) -> list[Any]:
    return [kind for kind in kinds if is_dataclass(kind)]


def _hints(kind: Any) -> dict[str, Any]:
    """The annotations of a record's keys."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return {name.rstrip("_"): hint for name, hint in hints.items()}
