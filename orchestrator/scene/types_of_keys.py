"""The types that are allowed at a path of a scene, from the annotations of its records."""

from __future__ import annotations

import typing
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Any

from hapticlink.components.registry import Names
from hapticlink.components.specs.device import Device, DeviceBody
from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.paths import AnySine
from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene import registry_tables
from hapticlink.orchestrator.scene.device_files import DeviceBodyTable, DeviceTable
from hapticlink.orchestrator.scene.extends import SceneFile
from hapticlink.orchestrator.scene.families import FamilyLinkage
from hapticlink.orchestrator.scene.hold_tables import HoldTable
from hapticlink.orchestrator.scene.rates import Trace, VariableRate
from hapticlink.orchestrator.scene.recorded_tables import RecordedTable
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import Wire
from hapticlink.orchestrator.scene.signal_sources import WrittenWire
from hapticlink.orchestrator.scene.toml_keys import Path, value

_WRITTEN: dict[Any, Any] = {
    Scene: SceneFile,
    Linkage: FamilyLinkage,
    Wire: WrittenWire,
    Device: DeviceTable,
    DeviceBody: DeviceBodyTable,
}
"""Records that have further keys in a file, which are resolved before the record is read."""


def keys(kinds: list[Any]) -> set[str]:
    return {name for kind in _records(kinds) for name in hints(kind)}


def types(kind: Any) -> tuple[str, ...]:
    """The values of `type` that select a record, its default first; none without that key."""
    return typing.get_args(hints(kind)["type"]) if "type" in keys([kind]) else ()


def choose_by_type(kinds: list[Any], table: Any) -> list[Any]:
    """The records among `kinds` that `table` selects by its `type`; all where it selects none."""
    name = table.get("type") if isinstance(table, dict) else None
    return [k for k in _records(kinds) if name in types(k)] or kinds


def types_at(path: Path, data: Any = None) -> list[Any]:
    """The types that the value at `path` may have, unions and annotations taken apart."""
    return [branch for kind in annotations_at(path, data) for branch in branches(kind)]


def annotations_at(path: Path, data: Any = None) -> list[Any]:
    """The annotations of the value at `path`; with the scene's `data`, only those of the records
    that its tables select by their `type`."""
    if not path:
        return [Scene]
    if record := registry_tables.record_of(path, data):
        return [record]
    above, part = choose_by_type(types_at(path[:-1], data), value(data, path[:-1])), path[-1]
    if isinstance(part, int):
        tuples = [typing.get_args(k) for k in above if typing.get_origin(k) is tuple]
        entries = [t[0] if Ellipsis in t else t[part] for t in tuples if t[part:] or Ellipsis in t]
        return list(dict.fromkeys(entries))
    named = [typing.get_args(k)[1] for k in above if typing.get_origin(k) is Mapping]
    return named + [hint for kind in _records(above) if (hint := hints(kind).get(part))]


def branches(kind: Any) -> list[Any]:
    """The members of a union, without their annotations."""
    return [branch for branch, _ in find_quantities(kind)]


def find_quantities(
    kind: Any, quantity: Quantity | None = None
) -> Iterator[tuple[Any, Quantity | None]]:
    """The members of a union, each with the quantity in its annotation; names of a registry become
    literals."""
    origin = typing.get_origin(kind)
    if origin is typing.Annotated:
        inner, *beside = typing.get_args(kind)
        names = next((b for b in beside if isinstance(b, Names)), None)
        if names:
            inner = typing.Literal[tuple(names)]
        yield from find_quantities(
            inner, next((b for b in beside if isinstance(b, Quantity)), quantity)
        )
        if names and names.registry is HOLDS:
            yield HoldTable, None
    elif origin in (typing.Union, UnionType):
        for member in typing.get_args(kind):
            yield from find_quantities(member, quantity)
    else:
        yield kind, quantity
        if kind is VariableRate:
            yield Trace, None
        if kind in typing.get_args(AnySine):
            yield RecordedTable, None


def is_needed(path: Path, of: Any = None) -> bool:
    """Whether the key at `path` has no default, in the record `of` or in any."""
    kinds = [of] if of else _records(types_at(path[:-1]))
    return any(
        path[-1] in hints(kind) and default(kind, str(path[-1])) is MISSING for kind in kinds
    )


def default(kind: Any, key: str) -> Any:
    """The default of a record's key, MISSING where it is required."""
    entry = next(f for f in fields(as_written(kind)) if f.name.rstrip("_") == key)
    return entry.default_factory() if entry.default_factory is not MISSING else entry.default


@cache
def hints(kind: Any) -> dict[str, Any]:
    typed = typing.get_type_hints(as_written(kind), include_extras=True)
    return {name.rstrip("_"): hint for name, hint in typed.items() if name[0] != "_"}  # `from_`


def _records(kinds: list[Any]) -> list[Any]:
    return [kind for kind in kinds if is_dataclass(kind)]


def as_written(record: Any) -> Any:
    """The record of a table as a file writes it."""
    return _WRITTEN.get(record, record)
