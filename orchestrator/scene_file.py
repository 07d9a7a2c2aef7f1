"""From a TOML file to a `Scene`: all faults at once, each with its place and a remedy."""

from __future__ import annotations

import difflib
import importlib.resources
import tomllib
import typing
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path as FilePath
from typing import Any

import pydantic
from pydantic_core import to_json

from hapticlink.orchestrator import families, overrides, scene_checks
from hapticlink.orchestrator.faults import Finding, InputFault, SceneFault
from hapticlink.orchestrator.frame_trace import frame_times
from hapticlink.orchestrator.latency import Latency
from hapticlink.orchestrator.scene import Scene, adapter
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
    """Find, change by `options` (`key=value`) and check a scene: a file, a shipped one, an SSP."""
    if scene.endswith(".ssp"):
        from hapticlink.orchestrator import ssp_read  # its XML parsers take a while to load

        data = ssp_read.tables(FilePath(scene))
        keys = {overrides.parse(o)[0] for o in options}
        needed = [("duration", "3")] * ("duration" not in data)
        needed += [("haptics.rate", "100")] * ("haptics" not in data)
        if missing := [n for n in needed if tuple(n[0].split(".")) not in keys]:
            say = "neither it nor its FMUs' DefaultExperiment say: give e.g. --set {}={}"
            raise SceneFault(scene, [Finding(key, say.format(key, v)) for key, v in missing])
        return from_tables(data, options, scene, {})
    name, text = find(scene)
    return read(text, options, name, _folder(scene))


def read(
    text: str, options: Sequence[str] = (), name: str = "scene", folder: FilePath | None = None
) -> Scene:
    """The scene that `text` writes, its relative paths from `folder`. Raises SceneFault with every
    finding, InputFault for an option that cannot be applied."""
    return from_tables(_document(text, name, folder), options, name, key_lines(text))


def from_tables(
    data: dict[str, Any], options: Sequence[str], name: str, lines: dict[Path, int]
) -> Scene:
    """The scene of the tables `data`, whose keys stand on `lines`; faults as of `read`."""
    which = [o for o in options if families.is_argument(overrides.parse(o)[0])]
    set_by = {overrides.apply(data, option): option for option in which}
    data = _with_family(data, name, lines, set_by)
    set_by |= {overrides.apply(data, o): o for o in options if o not in which}
    for table in ("holds", "delays", "kinds"):
        if isinstance(data.get(table), dict):
            data[table] = dict(_flat(data[table]))
    for traced in _traced(data):
        traced["rate"] = frame_times(FilePath(traced["rate"]["trace"]))
    for fmu in _tables_of(data, "fmu"):
        if isinstance(fmu.get("start"), dict):
            fmu["start"] = dict(_flat(fmu["start"]))

    def place(path: Path, message: str) -> Finding:
        key = _dotted(path, data)
        for length in range(len(path), 0, -1):
            if path[:length] in set_by:
                return Finding(key, message, option=f"--set {set_by[path[:length]]}")
        return Finding(key, message, line=line_of(path, lines))

    try:
        # As JSON, because strict JSON takes arrays for tuples and still refuses "1" for 1.
        document = to_json(data, inf_nan_mode="constants")
        found = adapter().validate_json(document)
    except pydantic.ValidationError as error:
        found_there = problems(error.errors(include_url=False), data)
        found_there += beyond(found_there, data)
        raise SceneFault(name, [place(*problem) for problem in found_there]) from None
    if findings := [place(path, message) for path, message in scene_checks.check(found)]:
        raise SceneFault(name, findings)
    if found.device and found.device.sensing != found.sensing:
        found = replace(found, device=replace(found.device, sensing=found.sensing))
    object.__setattr__(found, "_place", place)
    return found


def _folder(scene: str) -> FilePath | None:
    return FilePath(scene).parent if FilePath(scene).is_file() else None


def _document(
    text: str, name: str, folder: FilePath | None, above: tuple[str, ...] = ()
) -> dict[str, Any]:
    """The tables of a scene, laid over those of the scene that it `extends`."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneFault(name, [Finding("", f"not TOML: {error}")]) from error
    for fmu in _tables_of(data, "fmu"):
        if folder and isinstance(fmu.get("path"), str):
            fmu["path"] = str(folder / fmu["path"])
    for table in _traced(data) if folder else ():
        table["rate"] = {"trace": str(folder / table["rate"]["trace"])}
    base = data.pop("extends", None)
    if base is None:
        return data
    if base in above:
        raise InputFault(f"{name}: `extends` runs in a circle: {' -> '.join((*above, base))}")
    if not isinstance(base, str):
        raise SceneFault(name, [Finding("extends", f"{base!r}: write a scene's name or path")])
    below = _document(find(base)[1], base, _folder(base), (*above, base))
    return _laid_over(below, data)


def _with_family(
    data: dict[str, Any], name: str, lines: dict[Path, int], set_by: Mapping[Path, str]
) -> dict[str, Any]:
    """The scene with a linkage's `family` and `n` written out as bodies, joints and loops."""
    linkage = data.get("linkage")
    if not isinstance(linkage, dict) or "family" not in linkage:
        return data
    try:
        made = families.members(linkage)
    except families.FamilyError as error:
        option = f"--set {set_by[error.path]}" if error.path in set_by else None
        line = line_of(error.path, lines)
        finding = Finding(".".join(map(str, error.path)), error.message, line, option)
        raise SceneFault(name, [finding]) from None
    said = {k: v for k, v in linkage.items() if k not in families.ARGUMENTS}
    return {**data, "linkage": _laid_over(made, said)}


def _laid_over(base: dict[str, Any], top: Mapping[str, Any]) -> dict[str, Any]:
    """Tables merge key by key; anything else of `top`, and a table that names another `type`,
    takes the place of the base's."""
    merged = dict(base)
    for key, value in top.items():
        below = base.get(key)
        if isinstance(below, dict) and isinstance(value, dict) and _alike(below, value):
            value = _laid_over(below, value)
        merged[key] = value
    return merged


def _tables_of(data: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    """The entries of [[key]] that are tables; what else stands there is told later."""
    entries = data.get(key)
    return [e for e in entries if isinstance(e, dict)] if isinstance(entries, list) else []


def _alike(below: Mapping[str, Any], table: Mapping[str, Any]) -> bool:
    return bool(table.get("type", below.get("type")) == below.get("type"))


def _traced(data: Mapping[str, Any]) -> list[dict[str, Any]]:
    """[graphics] and [[fmu]] tables that say `rate = { trace = FILE }`."""
    graphics = data.get("graphics")
    tables = [*([graphics] if isinstance(graphics, dict) else []), *_tables_of(data, "fmu")]
    return [t for t in tables if isinstance(t.get("rate"), dict) and _is_trace(t["rate"])]


def _is_trace(rate: Mapping[str, Any]) -> bool:
    return rate.keys() == {"trace"} and isinstance(rate["trace"], str)


LATENCY = {f.name for f in fields(Latency)}


def _flat(table: Mapping[str, Any], prefix: str = "") -> typing.Iterator[tuple[str, Any]]:
    """[holds] written with bare dotted keys is nested; its keys are the whole names."""
    for key, value in table.items():
        if isinstance(value, dict) and not value.keys() <= LATENCY:
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
