"""Device files: the tables of [device] and [devices.NAME], merged over those of the file that each
`extends`, and bodies that are `like` others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path as FilePath
from typing import Any

from hapticlink.components.specs.device import Device, DeviceBody
from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault, near, shorten, unknown
from hapticlink.orchestrator.scene.find_scene import find_scene
from hapticlink.orchestrator.scene.merge import merge
from hapticlink.orchestrator.scene.toml_keys import (
    Path,
    Place,
    Problem,
    entries,
    read_document,
    tables_of_users,
    value,
)

DEFAULT = "twin"
MAX_EXTENDED = 20
"""Device files that extend one another."""


@dataclass(frozen=True, kw_only=True)
class DeviceTable(Device):
    """A linkage with motors and encoders: a device file, over which the other keys are merged, or
    bodies, joints and handle of one's own."""

    extends: str | None = None
    """The device file: the name of a shipped one, or a path relative to the scene. By default twin,
    of a scene whose device has no bodies of its own."""


@dataclass(frozen=True, kw_only=True)
class DeviceBodyTable(DeviceBody):
    """A rigid body of a device, or one like another."""

    like: str | None = None
    """The body whose mass, inertia and centre it has, where it does not say otherwise."""


def device_tables(data: Mapping[str, Any]) -> Iterator[tuple[Path, dict[str, Any]]]:
    """The tables of all devices of a scene, with their paths."""
    paths: list[Path] = [("fmu", i, "settings", "device") for i in range(len(entries(data, "fmu")))]
    for path, table in (*tables_of_users(data, "device"), *((p, value(data, p)) for p in paths)):
        if isinstance(table, dict):
            yield path, table


def is_choice(names: tuple[str, ...]) -> bool:
    """Whether an option chooses a device file."""
    return names[-1:] == ("extends",) and names[0] in ("device", "devices")


def locate(data: Mapping[str, Any], folder: FilePath) -> None:
    """Makes the paths of device files those from everywhere, of a scene in `folder`."""
    for _, table in device_tables(data):
        name = table.get("extends")
        if isinstance(name, str) and text_files.exists(folder / name):
            table["extends"] = str(folder / name)


@dataclass(frozen=True)
class DeviceKeys:
    """The file and line of the keys that a scene has from its device files, and what is wrong with
    the names of files, bodies and joints."""

    places: dict[Path, Place]
    problems: list[Problem]


def put_device_files(data: Mapping[str, Any], written: Mapping[Path, Place]) -> DeviceKeys:
    """Puts its device files into the tables of a scene, whose keys are `written` at places. What it
    says of a body or joint by name, `[device.body.crank]`, is merged over the file's."""
    places: dict[Path, Place] = {}
    problems: list[Problem] = []
    for path, table in [*device_tables(data)]:
        own_bodies = isinstance(table.get("body"), list)
        name = table.pop("extends", None if own_bodies else DEFAULT)
        if name is None:
            continue
        try:
            below, where = _read(name, path)
        except InputFault as fault:
            problems.append(((*path, "extends"), str(fault)))
            continue
        named = {key: table.pop(key) for key in NAMED if isinstance(table.get(key), dict)}
        replaced: set[Path] = set()
        whole = merge(below, table, replaced, path)
        places |= where
        for at in [*where] if replaced else ():
            if any(at[:i] in replaced for i in range(len(at) + 1)):
                del places[at]
        for key, changed in named.items():
            for entry, changes in changed.items():
                index = _index(whole.get(key), entry)
                if index is None or not isinstance(changes, dict):
                    known = [str(e.get("name")) for e in whole.get(key, ())]
                    problems.append(((*path, key, entry), unknown(key, entry, known)))
                    continue
                whole[key][index] = merge(whole[key][index], changes, set())
                here = (*path, key, entry)
                places |= {
                    (*path, key, index, *at[len(here) :]): place
                    for at, place in written.items()
                    if at[: len(here)] == here
                }
        table.clear()
        table.update(whole)
    return DeviceKeys(places, problems)


NAMED = ("body", "joint")
"""Arrays of a device file whose entries a scene can change by their names."""


def _index(entries: Any, name: str) -> int | None:
    named = [e.get("name") for e in entries] if isinstance(entries, list) else []
    return named.index(name) if name in named else None


def _read(
    name: Any, above: Path, folder: FilePath | None = None, depth: int = 0
) -> tuple[Any, Mapping[Path, Place]]:
    """The tables of a device file, over those of the one that it extends; file and line of each
    key, whose path begins with that of the device."""
    if not isinstance(name, str):
        raise InputFault(f"{shorten(repr(name))}: write a device's name or path")
    if depth >= MAX_EXTENDED:
        raise InputFault(f"{shorten(name)}: the last of {MAX_EXTENDED} files, each over the next")
    _, text, where = find_scene(name, folder, "device")
    file = str(where / FilePath(name).name) if where else name
    try:
        tables, lines = read_document(text)[0], _locate_keys(text, file, above)
    except ValueError as error:
        raise InputFault(f"{file}: not TOML: {error}") from error
    base = tables.pop("extends", None)
    if base is None:
        return tables, lines
    below, further = _read(base, above, where, depth + 1)
    return merge(below, tables, set()), {**further, **lines}


@lru_cache(64)  # the same files in each variant of a scene
def _locate_keys(text: str, file: str, above: Path) -> Mapping[Path, Place]:
    """File and line of the keys of a text."""
    return {(*above, *key): (file, line) for key, line in read_document(text)[1].items()}


def put_likes(data: Mapping[str, Any]) -> list[Problem]:
    """Gives bodies that are `like` another what they do not say themselves; returns what is wrong
    with the names."""
    problems: list[Problem] = []
    for path, table in device_tables(data):
        bodies = [b for b in entries(table, "body") if isinstance(b, dict)]
        own = {b["name"]: b for b in bodies if isinstance(b.get("name"), str) and "like" not in b}
        for i, body in enumerate(bodies):
            if "like" not in body:
                continue
            model = body.pop("like")
            if model in own:
                body |= {k: v for k, v in own[model].items() if k not in body}
                continue
            why = f"{shorten(repr(model))} is no body that says its own; {near(str(model), own)}"
            problems.append(((*path, "body", i, "like"), why))
    return problems


_OF_ALL_ARMS = "[[device.body]] and [[device.joint]] of a device file that extends twin"
NOW = {
    "proximal_length": f"lengths are those between pins: `at_parent` in {_OF_ALL_ARMS}",
    "distal_length": f"lengths are those between pins: `at_parent` and `at` in {_OF_ALL_ARMS}",
    "crank": f"its length is that between pins: `at_child` and `at` in {_OF_ALL_ARMS}",
    "base_x": f"base joints are at `at_parent` in {_OF_ALL_ARMS}",
    "base_half_width": f"base joints are at `at_parent` in {_OF_ALL_ARMS}",
    "base_y_a": f"base joints are at `at_parent` in {_OF_ALL_ARMS}",
    "base_y_b": f"base joints are at `at_parent` in {_OF_ALL_ARMS}",
    "rotor_inertia": "write motor.inertia",
    "proximal_mass": "write body.a_left_proximal.mass, which the other arms are like",
    "proximal_center": "write body.a_left_proximal.center = [x, 0], which the other arms are like",
    "proximal_inertia": "write body.a_left_proximal.inertia, which the other arms are like",
    "distal_mass": "write body.a_left_distal.mass, which the other arms are like",
    "distal_center": "write body.a_left_distal.center = [x, 0], which the other arms are like",
    "distal_inertia": "write body.a_left_distal.inertia, which the other arms are like",
    "handle_mass": "write body.crank.mass",
    "handle_inertia": "write body.crank.inertia",
    "motor_damping": "write motor.damping",
    "motor_friction": "write motor.friction",
    "torque_limit": "write motor.torque_limit",
    "encoder_resolution": "write encoder.resolution",
    "reach_limit": "write stop.reach",
    "stop_stiffness": "write stop.stiffness",
    "stop_damping": "write stop.damping",
}
"""What became of the keys of [device] when the twin pantograph was the only device."""


def find_old_keys(data: Mapping[str, Any]) -> Iterator[Problem]:
    for path, table in device_tables(data):
        for key in (key for key in table if key in NOW):
            remedy = NOW[key].replace("write ", f"write {'.'.join(map(str, path))}.")
            yield (*path, key), f"a device is a linkage now: {remedy}"
