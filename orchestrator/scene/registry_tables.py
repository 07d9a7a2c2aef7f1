"""Tables whose keys are defined by a part of a registry: `settings` of an [[fmu]] with a `block`,
the entries of [[linkage.force]], and holds with parameters (`hold_tables`)."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, replace
from functools import cache
from typing import Any

import pydantic

from hapticlink.components.blocks import BLOCKS
from hapticlink.orchestrator.scene import hold_tables
from hapticlink.orchestrator.scene.argument_records import errors_at, make_record, read_strictly
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem, entries, value


def _tables(data: Any) -> Iterator[tuple[Path, Any]]:
    """Path and content of every such table in a scene's `data`; missing settings are added as an
    empty table."""
    for i, fmu in enumerate(entries(data, "fmu")):
        if isinstance(fmu, dict) and "block" in fmu:
            yield ("fmu", i, "settings"), fmu.setdefault("settings", {})
    for i, force in enumerate(entries(data, "linkage", "force")):
        yield ("linkage", "force", i), force


def record_of(path: Path, data: Any) -> Any:
    """The record that defines the table at `path` of a scene's `data`; None where the registry has
    no part of that name, and for any other table."""
    match path:
        case ("hold",) | ("downsampling",) | ("holds", _) | ("connection", int(), "hold"):
            return hold_tables.parameters_of(value(data, (*path, "type")))
        case ("fmu", int(), "settings"):
            name = value(data, (*path[:2], "block"))
            return _arguments(BLOCKS[name]) if name in tuple(BLOCKS) else None
        case ("linkage", "force", int()) if (name := value(data, (*path, "type"))) is not None:
            from hapticlink.components.forces import FORCES  # loads CasADi

            return FORCES[name] if name in tuple(FORCES) else None
    return None


@cache
def _arguments(block: Callable[..., Any]) -> Any:
    """A record of a block's arguments."""
    return make_record("Settings", inspect.signature(block).parameters.values(), block.__module__)


def read_registry_tables(data: Any) -> tuple[dict[Path, Any], list[Any], list[Problem]]:
    """The records of such tables in a scene's `data`, by path, read as strictly as the scene's own;
    pydantic's errors in them, and the problems found besides."""
    records: dict[Path, Any] = {}
    errors: list[Any] = []
    names: set[Any] = set()
    wrong: list[Problem] = []
    for path, table in _tables(data):
        if path[0] == "linkage":
            wrong += _of_a_force(path, table, names)
        record = record_of(path, data)
        if record is None:
            continue
        try:
            records[path] = read_strictly(record, table)
        except pydantic.ValidationError as error:
            errors += errors_at(path, error)
    return records, errors, wrong


def _of_a_force(path: Path, table: Any, names: set[Any]) -> Iterator[Problem]:
    """Problems with `type` and `name` of an entry of [[linkage.force]]."""
    from hapticlink.components.forces import FORCES

    if not isinstance(table, dict):
        yield path, f"{table!r}: write a table, [[linkage.force]]"
        return
    if "type" not in table:
        yield (*path, "type"), "is missing: which force is it?"
    elif table["type"] not in tuple(FORCES):
        yield (*path, "type"), FORCES.unknown(str(table["type"]))
    name = str(table.get("name"))
    if name in names:
        yield (*path, "name"), f"{name!r} is taken: name each force once"
    if "name" in table:
        names.add(name)


def put_registry_tables(scene: Scene, records: Mapping[Path, Any]) -> Scene:
    """The scene with such tables replaced by the records that `read_registry_tables` gave."""

    def settings(i: int) -> dict[str, Any]:
        record = records["fmu", i, "settings"]
        return {f.name: getattr(record, f.name) for f in fields(record)}

    fmus = (replace(f, settings=settings(i)) if f.block else f for i, f in enumerate(scene.fmu))
    scene = replace(scene, fmu=tuple(fmus))
    if scene.linkage and scene.linkage.force:
        forces = (records["linkage", "force", i] for i in range(len(scene.linkage.force)))
        scene = replace(scene, linkage=replace(scene.linkage, force=tuple(forces)))
    return scene
