"""Resolves `extends` and linkage families: a scene's tables merged over those it builds on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

from hapticlink.orchestrator.base.errors import Finding, InputFault, SceneFault, shorten, unknown
from hapticlink.orchestrator.scene import device_files, families, toml_keys
from hapticlink.orchestrator.scene.find_scene import find_scene
from hapticlink.orchestrator.scene.merge import merge
from hapticlink.orchestrator.scene.rates import find_traces
from hapticlink.orchestrator.scene.recorded_tables import find_recorded_tables
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import (
    Path,
    Place,
    entries,
    flatten,
    flatten_path,
    parts,
    place_of,
    read_document,
)

MAX_EXTENDED = 20
"""Scenes that extend one another."""


@dataclass(frozen=True, kw_only=True)
class SceneFile(Scene):
    """A complete experiment. A block is simulated if its table is present; a scene with nothing but
    a [linkage] runs the mechanism alone."""

    extends: str | None = None
    """The base scene, over which this one's tables are merged: the name of a shipped scene, or a
    path relative to this file. Tables merge key by key; arrays, and tables of another `type`,
    replace those of the base."""
    drop: tuple[str, ...] = ()
    """Dotted keys of the base scene that are not inherited, such as `linkage` or `hand.wrench`, for
    a linkage of one's own in the loop of the base. This file can write them anew."""


def document(
    text: str, name: str, folder: FilePath | None, above: tuple[str, ...] = (), file: str = ""
) -> tuple[dict[str, Any], dict[Path, Place]]:
    """The tables of a scene, merged over those of the scene that it `extends`, and the file and
    line of each key.

    folder: where relative paths start. above: the scenes that extend this one, the first one
    first. file: the name by which they refer to this one. Raises SceneFault for text that is no
    TOML, a base that cannot be read, and scenes that extend each other in a circle.
    """
    try:
        data, lines = read_document(text)
    except ValueError as error:
        raise SceneFault(name, [Finding("", f"not TOML: {error}", file=file)]) from error
    flatten(data)
    places = {flatten_path(path): (file, line) for path, line in lines.items()}
    for fmu in tables_of(data, "fmu"):
        if folder and isinstance(fmu.get("path"), str):
            fmu["path"] = str(folder / fmu["path"])
    if folder and data.get("resume") and isinstance(data["resume"], str):
        data["resume"] = str(folder / data["resume"])
    for _, table in find_traces(data) if folder else ():
        table["rate"] = {"trace": str(folder / table["rate"]["trace"])}
    if folder:
        for _, holder, key in find_recorded_tables(data):
            holder[key] = {**holder[key], "path": str(folder / str(holder[key]["path"]))}
    if folder:
        device_files.locate(data, folder)
    base, dropped = data.pop("extends", None), data.pop("drop", [])

    def refuse(message: str, key: str = "extends") -> SceneFault:
        _, line = place_of((key,), places)
        return SceneFault(above[0] if above else name, [Finding(key, message, line, None, file)])

    if base is None:
        if dropped != []:
            raise refuse("there is no base scene: write `extends` as well", "drop")
        return data, places
    if not isinstance(base, str):
        raise refuse(f"{base!r}: write a scene's name or path")
    try:
        _, base_text, where = find_scene(base, folder)
    except InputFault as fault:
        raise refuse(f"{fault}; a path is relative to this file") from None
    if len(above) >= MAX_EXTENDED:
        raise refuse(f"the last of {MAX_EXTENDED} scenes, each over the next: put some into one")
    base = str(where / FilePath(base).name) if where else base
    so_far = (*(above or (name,)), str(FilePath(base).resolve()) if where else base)
    if so_far[-1] in above:
        raise refuse(f"runs in a circle: {' -> '.join(so_far)}")
    below, below_places = document(base_text, base, where, so_far, base)
    below = _drop_keys(below, dropped, lambda message: refuse(message, "drop"))
    replaced: set[Path] = set()
    merged = merge(below, data, replaced)
    inherited = {
        path: place
        for path, place in below_places.items()
        if toml_keys.value(below, path) is not None
        and not any(path[:i] in replaced for i in range(1, len(path) + 1))
    }
    return merged, inherited | places


def _drop_keys(
    base: dict[str, Any], keys: Any, refuse: Callable[[str], Exception]
) -> dict[str, Any]:
    """The tables of `base` without the dotted `keys`. Raises `refuse` with the reason where `keys`
    is no list of them, or names one that the base does not have."""
    if not isinstance(keys, list) or not all(isinstance(key, str) for key in keys):
        raise refuse(f"{shorten(repr(keys))}: write a list of dotted keys")
    for key in keys:
        try:
            names = parts(key)
        except ValueError:
            raise refuse(f"{shorten(key)!r} is no dotted key") from None
        base = _without(base, names, refuse)
    return base


def _without(
    table: dict[str, Any], names: tuple[str, ...], refuse: Callable[[str], Exception]
) -> dict[str, Any]:
    first, *rest = names
    if first not in table:
        raise refuse(f"not in the base scene: {unknown('key', first, [*table])}")
    if not rest:
        return {key: value for key, value in table.items() if key != first}
    if not isinstance(table[first], Mapping):
        raise refuse(f"{shorten(first)} is no table in the base scene: drop it as a whole")
    return {**table, first: _without(table[first], tuple(rest), refuse)}


def with_family(data: dict[str, Any]) -> dict[str, Any]:
    """The scene with a linkage's `family` and `n` expanded into bodies, joints and loops, over
    which its other keys are merged. Raises FamilyError for an unknown family or a bad `n`."""
    linkage = data.get("linkage")
    if not isinstance(linkage, dict) or "family" not in linkage:
        return data
    others = {k: v for k, v in linkage.items() if k not in families.ARGUMENTS}
    return {**data, "linkage": merge(families.members(linkage), others, set())}


def tables_of(data: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    """The entries of [[key]] that are tables; anything else is reported by the schema."""
    return [entry for entry in entries(data, key) if isinstance(entry, dict)]
