"""Reads the tables whose keys are defined by a part of a registry (`registry_tables`), as strictly
as the scene's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, make_dataclass, replace
from functools import cache
from typing import Any

import pydantic
from pydantic_core import to_json

from hapticlink.orchestrator.base.errors import InputFault, shortened
from hapticlink.orchestrator.scene.refused_keys_and_values import problems
from hapticlink.orchestrator.scene.registry_tables import record_of, tables
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def read(data: Any) -> tuple[dict[Path, Any], list[Problem]]:
    """The records of such tables in a scene's `data`, by path, and the problems found in them."""
    records: dict[Path, Any] = {}
    errors: list[Any] = []
    names: set[Any] = set()
    wrong: list[Problem] = []
    for path, table in tables(data):
        if path[0] == "linkage":
            wrong += _of_a_force(path, table, names)
        record = record_of(path, data)
        if record is None:
            continue
        try:
            text = to_json({"table": table}, inf_nan_mode="constants")
            records[path] = _reader(record).validate_json(text).table
        except pydantic.ValidationError as error:
            problems_of_part = error.errors(include_url=False)
            errors += [{**e, "loc": (*path, *e["loc"][1:])} for e in problems_of_part]
    return records, wrong + problems(errors, data)


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


@cache
def _reader(record: Any) -> pydantic.TypeAdapter[Any]:
    """A pydantic reader of a record with a scene's strictness: no unknown keys, no text for a
    number."""
    rules = {"__pydantic_config__": Scene.__pydantic_config__}
    holder = make_dataclass("Holder", [("table", record)], namespace=rules)
    try:
        reader: pydantic.TypeAdapter[Any] = pydantic.TypeAdapter(holder)
        reader.rebuild(raise_errors=True)
        return reader
    except (pydantic.errors.PydanticUserError, NameError) as error:
        why = shortened(str(error).partition("\n")[0])
        message = f"{record.__module__}: the annotations of {record.__name__} cannot be read: {why}"
        raise InputFault(message) from error


def put(scene: Scene, records: Mapping[Path, Any]) -> Scene:
    """The scene with such tables replaced by the records that `read` returned."""

    def settings(i: int) -> dict[str, Any]:
        record = records["fmu", i, "settings"]
        return {f.name: getattr(record, f.name) for f in fields(record)}

    fmus = (replace(f, settings=settings(i)) if f.block else f for i, f in enumerate(scene.fmu))
    scene = replace(scene, fmu=tuple(fmus))
    if scene.linkage and scene.linkage.force:
        forces = (records["linkage", "force", i] for i in range(len(scene.linkage.force)))
        scene = replace(scene, linkage=replace(scene.linkage, force=tuple(forces)))
    return scene
