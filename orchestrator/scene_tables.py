"""The tables of a scene as it was meant: laid over those it extends, families written out."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path as FilePath
from typing import Any

from hapticlink.orchestrator import families
from hapticlink.orchestrator.faults import Finding, InputFault, SceneFault
from hapticlink.orchestrator.latency import Latency
from hapticlink.orchestrator.scene_names import find, folder_of
from hapticlink.orchestrator.toml_lines import Path, line_of


def document(
    text: str, name: str, folder: FilePath | None, above: tuple[str, ...] = ()
) -> dict[str, Any]:
    """The tables of a scene, laid over those of the scene that it `extends`."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneFault(name, [Finding("", f"not TOML: {error}")]) from error
    for fmu in tables_of(data, "fmu"):
        if folder and isinstance(fmu.get("path"), str):
            fmu["path"] = str(folder / fmu["path"])
    for table in traced(data) if folder else ():
        table["rate"] = {"trace": str(folder / table["rate"]["trace"])}
    base = data.pop("extends", None)
    if base is None:
        return data
    if base in above:
        raise InputFault(f"{name}: `extends` runs in a circle: {' -> '.join((*above, base))}")
    if not isinstance(base, str):
        raise SceneFault(name, [Finding("extends", f"{base!r}: write a scene's name or path")])
    below = document(find(base)[1], base, folder_of(base), (*above, base))
    return _laid_over(below, data)


def with_family(
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


def tables_of(data: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    """The entries of [[key]] that are tables; what else stands there is told later."""
    entries = data.get(key)
    return [e for e in entries if isinstance(e, dict)] if isinstance(entries, list) else []


def _alike(below: Mapping[str, Any], table: Mapping[str, Any]) -> bool:
    return bool(table.get("type", below.get("type")) == below.get("type"))


def traced(data: Mapping[str, Any]) -> list[dict[str, Any]]:
    """[graphics] and [[fmu]] tables that say `rate = { trace = FILE }`."""
    graphics = data.get("graphics")
    tables = [*([graphics] if isinstance(graphics, dict) else []), *tables_of(data, "fmu")]
    return [t for t in tables if isinstance(t.get("rate"), dict) and _is_trace(t["rate"])]


def _is_trace(rate: Mapping[str, Any]) -> bool:
    return rate.keys() == {"trace"} and isinstance(rate["trace"], str)


LATENCY = {f.name for f in fields(Latency)}


def flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """[holds] written with bare dotted keys is nested; its keys are the whole names."""
    for key, value in table.items():
        if isinstance(value, dict) and not value.keys() <= LATENCY:
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value
