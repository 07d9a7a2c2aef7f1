"""Reads a TOML file as a `Scene`, and reports all faults at once, each with place and remedy."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from itertools import islice
from pathlib import Path as FilePath

import pydantic
from pydantic_core import to_json

from hapticlink.orchestrator.base.errors import COUNTED, InputFault, SceneFault
from hapticlink.orchestrator.scene import checks, families, overrides, read_registry_tables
from hapticlink.orchestrator.scene.extends import document, tables_of, traced, with_family
from hapticlink.orchestrator.scene.frame_trace import frame_times
from hapticlink.orchestrator.scene.refused_keys_and_values import beyond, problems
from hapticlink.orchestrator.scene.scene import Scene, WrittenScene, adapter
from hapticlink.orchestrator.scene.scene_source import Origin, Source
from hapticlink.orchestrator.scene.toml_keys import flat, flatten
from hapticlink.orchestrator.scene.unrepresentable_values import unsound


def read(
    text: str, options: Sequence[str] = (), name: str = "scene", folder: FilePath | None = None
) -> Scene:
    """The scene that `text` writes, changed by `options`; relative paths start at `folder`.

    Raises SceneFault with every finding, InputFault for an option that cannot be applied.
    """
    return from_source(Source(name, *document(text, name, folder), tuple(options)))


def from_source(source: Source) -> Scene:
    """The scene of the tables of `source`, changed by its options; raises as `read` does."""
    data, options = deepcopy(dict(source.tables)), source.options
    name = source.name
    # Options of the family come first, since others may change the bodies that it expands to.
    of_family = [o for o in options if families.is_argument(overrides.parse(o)[0])]
    set_by = {**source.set_by, **{overrides.apply(data, option): option for option in of_family}}
    data = with_family(data, name, source.places, set_by)
    set_by |= {overrides.apply(data, o): o for o in options if o not in of_family}
    if wrong := [*islice(unsound(data), COUNTED)]:
        origin = Origin(source, data, set_by)
        raise SceneFault(name, [origin.finding(*problem) for problem in wrong])
    flatten(data)
    for path, recorded in traced(data):
        try:
            recorded["rate"] = frame_times(FilePath(recorded["rate"]["trace"]))
        except InputFault as fault:
            wrong.append(((*path, "rate"), str(fault)))
            del recorded["rate"]
    for fmu in tables_of(data, "fmu"):
        for key in ("start", "derivatives"):
            if isinstance(fmu.get(key), dict):
                fmu[key] = dict(flat(fmu[key]))

    origin = Origin(source, data, set_by)
    parts, unread = read_registry_tables.read(data)
    wrong += unread
    try:
        # As JSON: strict pydantic then takes arrays for tuples, and still refuses "1" for 1.
        scene = adapter().validate_json(to_json(data, inf_nan_mode="constants"))
    except pydantic.ValidationError as error:
        wrong += problems(error.errors(include_url=False), data)
    if wrong:
        wrong += beyond(wrong, data)[: COUNTED - len(wrong)]
        raise SceneFault(name, [origin.finding(*problem) for problem in wrong])
    if wrong := checks.check(scene):
        raise SceneFault(name, [origin.finding(*problem) for problem in wrong])
    scene = read_registry_tables.put(scene, parts)
    return WrittenScene(**vars(scene), origin=origin, written=scene)
