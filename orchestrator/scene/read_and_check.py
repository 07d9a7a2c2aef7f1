"""Reads a TOML file as a `Scene`, and reports all faults at once, each with place and remedy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from itertools import compress, islice
from operator import not_
from pathlib import Path as FilePath
from typing import Any

import pydantic
from pydantic_core import to_json

from hapticlink.orchestrator.base.errors import COUNTED, SceneFault
from hapticlink.orchestrator.base.plain_data import plain
from hapticlink.orchestrator.base.type_adapters import adapter
from hapticlink.orchestrator.scene import (
    checks,
    device_files,
    families,
    hold_tables,
    overrides,
    registry_tables,
)
from hapticlink.orchestrator.scene.extends import document, tables_of, with_family
from hapticlink.orchestrator.scene.rates import find_traces, read_frame_times
from hapticlink.orchestrator.scene.recorded_tables import (
    COLUMNS,
    find_recorded_tables,
    read_recorded_table,
)
from hapticlink.orchestrator.scene.refused_keys_and_values import (
    explain_errors,
    find_further_problems,
    find_unrepresentable,
)
from hapticlink.orchestrator.scene.scene import Scene, WrittenScene
from hapticlink.orchestrator.scene.scene_source import Source
from hapticlink.orchestrator.scene.signal_sources import read_log, with_signals
from hapticlink.orchestrator.scene.toml_keys import (
    Path,
    Problem,
    collect_problem,
    flat,
    flatten,
    written_path,
)


def read_scene(
    text: str, options: Sequence[str] = (), name: str = "scene", folder: FilePath | None = None
) -> Scene:
    """The scene that `text` writes, changed by `options`; relative paths start at `folder`.

    Raises SceneFault with every finding, InputFault for an option that cannot be applied.
    """
    return from_source(Source(name, *document(text, name, folder), tuple(options)))


def _read_tables(data: dict[str, Any]) -> Scene:
    """The scene of tables. Those of the mechanism and the device are objects that other scenes of
    the same numbers have, too, so that what follows from them is found once."""
    shared: dict[str, Any] = {}
    alone = {"title": "", "duration": 1.0}
    for key in ("linkage", "device"):
        if isinstance(data.get(key), dict):
            with suppress(pydantic.ValidationError):  # which reading the whole tells
                shared[key] = _read_table(key, _write(alone | {key: data[key]}))
    rest = {key: table for key, table in data.items() if key not in shared}
    return replace(adapter(Scene).validate_json(_write(rest)), **shared)


@lru_cache(32)
def _read_table(key: str, text: bytes) -> Any:
    return getattr(adapter(Scene).validate_json(text), key)


def _write(data: dict[str, Any]) -> bytes:
    """As JSON: strict pydantic then takes arrays for tuples, and still refuses "1" for 1."""
    return to_json(data, inf_nan_mode="constants")


def from_source(source: Source) -> Scene:
    """The scene of the tables of `source`, changed by its options; raises as `read_scene` does."""
    data, set_by, read_from = plain(dict(source.tables)), dict(source.set_by), source
    # Options of a family or a device file come first, since others may change the bodies that it
    # expands to.
    given = [(option, overrides.parse(option)) for option in source.options]
    of_family = [
        families.is_argument(names) or device_files.is_choice(names) for _, (names, _) in given
    ]
    set_by |= {overrides.apply(data, *each): each[0] for each in compress(given, of_family)}
    try:
        data = with_family(data)
    except families.FamilyError as error:
        origin = replace(source, tables=data, options=(), set_by=set_by)
        raise SceneFault(source.name, [origin.finding(error.path, error.message)]) from None
    of_devices = device_files.put_device_files(data, source.places)
    source = replace(source, places={**source.places, **of_devices.places})
    others = compress(given, map(not_, of_family))
    set_by |= {overrides.apply(data, *each): each[0] for each in others}
    device_files.put_device_files(data, {})  # of devices that options have added
    origin = replace(source, tables=data, options=(), set_by=set_by)

    moved: dict[Path, int] = {}

    def refuse(problems: Iterable[Problem]) -> None:
        if found := [origin.finding(written_path(path, moved), why) for path, why in problems]:
            raise SceneFault(source.name, found)

    refuse(islice(find_unrepresentable(data), COUNTED))
    refuse([*of_devices.problems, *device_files.find_old_keys(data), *device_files.put_likes(data)])
    flatten(data)
    start, wrong = _start_time(data), list[Problem]()
    data, made = with_signals(data, start, wrong)
    refuse(wrong)
    moved |= made
    for path, recorded in find_traces(data):
        with collect_problem(wrong, (*path, "rate")):
            file = recorded.pop("rate")["trace"]
            recorded["rate"] = read_frame_times(FilePath(file), start)
    for path, holder, key in [*find_recorded_tables(data)]:
        with collect_problem(wrong, (*path, key)):
            if path[0] == "fmu":
                read_log(holder)
                continue
            columns = COLUMNS[key] if path[0] in ("hand", "hands") else ()
            holder[key] = read_recorded_table(holder.pop(key), columns, start)
    for fmu in tables_of(data, "fmu"):
        for key in ("start", "derivatives"):
            if isinstance(fmu.get(key), dict):
                fmu[key] = dict(flat(fmu[key]))
    parts, errors, unread = registry_tables.read_registry_tables(data)
    of_holds, unread_holds = hold_tables.read_hold_tables(data)
    errors, wrong = errors + of_holds, wrong + unread + unread_holds
    try:
        scene = _read_tables(data)
    except pydantic.ValidationError as error:
        errors += error.errors(include_url=False)
    if wrong := wrong + explain_errors(errors, data):
        refuse([*wrong, *find_further_problems(wrong, data)[: COUNTED - len(wrong)]])
    refuse(checks.check_scene(scene))
    scene = registry_tables.put_registry_tables(scene, parts)
    return WrittenScene(
        **vars(scene), read_from=read_from, origin=origin, written=scene, signals=moved
    )


def _start_time(data: Mapping[str, Any]) -> float:
    """That of a scene whose values have not been checked."""
    given = data.get("start_time")
    return float(given) if isinstance(given, int | float) and 0 <= given <= 1e5 else 0.0
