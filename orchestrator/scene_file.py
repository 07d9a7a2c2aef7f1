"""From a TOML file to a `Scene`: all faults at once, each with its place and a remedy."""

from __future__ import annotations

import difflib
import importlib.resources
import tomllib
import typing
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import pydantic
from pydantic_core import to_json

from hapticlink.orchestrator import overrides, scene_checks
from hapticlink.orchestrator.faults import Finding, InputFault, SceneFault
from hapticlink.orchestrator.scene import Scene
from hapticlink.orchestrator.scene_problems import beyond, problems
from hapticlink.orchestrator.toml_lines import Path, key_lines, line_of


def shipped() -> dict[str, Any]:
    """The scenes that come with the package, by name."""
    folder = importlib.resources.files("hapticlink.scenes")
    names = (entry for entry in folder.iterdir() if entry.name.endswith(".toml"))
    return {entry.name.removesuffix(".toml"): entry for entry in sorted(names, key=str)}


def find(scene: str) -> tuple[str, str]:
    """(name, text) of a scene: a path, or the name of a shipped one."""
    path, known = FilePath(scene), shipped()
    if path.is_file():
        try:
            return path.stem, path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InputFault(f"{scene}: cannot be read as text: {error}") from error
    if scene in known:
        return scene, known[scene].read_text(encoding="utf-8")
    near = difflib.get_close_matches(scene, known, 1)
    hint = f"did you mean {near[0]}?" if near else f"shipped scenes: {', '.join(known)}"
    raise InputFault(f"{scene}: neither a file nor a shipped scene; {hint}")


def load(scene: str, options: Sequence[str] = ()) -> Scene:
    """Find, change by `options` (`key=value`) and check a scene."""
    name, text = find(scene)
    return read(text, options, name)


def read(text: str, options: Sequence[str] = (), name: str = "scene") -> Scene:
    """The scene that `text` writes. Raises SceneFault with every finding, InputFault for an
    option that cannot be applied."""
    data = _document(text, name)
    lines = key_lines(text)
    set_by = {overrides.apply(data, option): option for option in options}
    if isinstance(data.get("holds"), dict):
        data["holds"] = dict(_flat(data["holds"]))

    def place(path: Path, message: str) -> Finding:
        key = _dotted(path, data)
        for length in range(len(path), 0, -1):
            if path[:length] in set_by:
                return Finding(key, message, option=f"--set {set_by[path[:length]]}")
        return Finding(key, message, line=line_of(path, lines))

    try:
        # As JSON, because strict JSON takes arrays for tuples and still refuses "1" for 1.
        document = to_json(data, inf_nan_mode="constants")
        found = pydantic.TypeAdapter(Scene).validate_json(document)
    except pydantic.ValidationError as error:
        found_there = problems(error.errors(include_url=False), data)
        found_there += beyond(found_there, data)
        raise SceneFault(name, [place(*problem) for problem in found_there]) from None
    if findings := [place(path, message) for path, message in scene_checks.check(found)]:
        raise SceneFault(name, findings)
    if found.device and found.device.sensing != found.sensing:
        found = replace(found, device=replace(found.device, sensing=found.sensing))
    return found


def _document(text: str, name: str, above: tuple[str, ...] = ()) -> dict[str, Any]:
    """The tables of a scene, laid over those of the scene that it `extends`."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneFault(name, [Finding("", f"not TOML: {error}")]) from error
    base = data.pop("extends", None)
    if base is None:
        return data
    if base in above:
        raise InputFault(f"{name}: `extends` runs in a circle: {' -> '.join((*above, base))}")
    if not isinstance(base, str):
        raise SceneFault(name, [Finding("extends", f"{base!r}: write a scene's name or path")])
    return _laid_over(_document(find(base)[1], base, (*above, base)), data)


def _laid_over(base: dict[str, Any], top: Mapping[str, Any]) -> dict[str, Any]:
    """Tables merge key by key; anything else of `top`, and a table that names another `type`,
    takes the place of the base's."""
    merged = dict(base)
    for key, value in top.items():
        below = base.get(key)
        both = isinstance(below, dict) and isinstance(value, dict)
        alike = both and value.get("type", below.get("type")) == below.get("type")
        merged[key] = _laid_over(below, value) if alike else value
    return merged


def _flat(table: Mapping[str, Any], prefix: str = "") -> typing.Iterator[tuple[str, Any]]:
    """[holds] written with bare dotted keys is nested; its keys are the whole names."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def _dotted(path: Path, data: Any) -> str:
    """`linkage.body[2] (link3).mass`: entries of arrays from 0, with their name."""
    text, node = "", data
    for part in path:
        try:
            node = node[part]
        except (KeyError, IndexError, TypeError):
            node = None
        if isinstance(part, int):
            name = node.get("name") if isinstance(node, dict) else None
            text += f"[{part}]" + (f" ({name})" if name else "")
        else:
            text += f".{part}" if text else part
    return text
