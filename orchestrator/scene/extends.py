"""The tables of a scene as it was meant: laid over those it extends, families written out."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

from hapticlink.orchestrator.base.faults import Finding, InputFault, SceneFault
from hapticlink.orchestrator.scene import families
from hapticlink.orchestrator.scene.find import find, folder_of
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Place, flatten, key_lines, place_of, whole


@dataclass(frozen=True, kw_only=True)
class SceneFile(Scene):
    """Everything a run needs. A block is simulated where its table is present; a scene with nothing
    but a [linkage] runs the mechanism alone."""

    extends: str | None = None
    """The scene over which this one's tables are laid: a shipped one by its name, or a path from
    the file that says it. Tables merge key by key; arrays, and tables of another `type`, replace
    those below."""


def document(
    text: str, name: str, folder: FilePath | None, above: tuple[str, ...] = (), file: str = ""
) -> tuple[dict[str, Any], dict[Path, Place]]:
    """The tables of a scene, laid over those of the scene that it `extends`, and where each key
    stands. `above` are the scenes that extend this one, `file` is its name to them."""
    try:
        data = tomllib.loads(text)
    except ValueError as error:  # TOMLDecodeError, or a whole number of thousands of digits
        raise SceneFault(name, [Finding("", f"not TOML: {error}", file=file)]) from error
    flatten(data)
    places = {whole(path): (file, line) for path, line in key_lines(text).items()}
    for fmu in tables_of(data, "fmu"):
        if folder and isinstance(fmu.get("path"), str):
            fmu["path"] = str(folder / fmu["path"])
    for _, table in traced(data) if folder else ():
        table["rate"] = {"trace": str(folder / table["rate"]["trace"])}
    base = data.pop("extends", None)
    if base is None:
        return data, places

    def refuse(message: str) -> SceneFault:
        _, line = place_of(("extends",), places)
        return SceneFault(
            above[0] if above else name, [Finding("extends", message, line, None, file)]
        )

    if not isinstance(base, str):
        raise refuse(f"{base!r}: write a scene's name or path")
    try:
        _, found = find(base, folder)
    except InputFault as fault:
        raise refuse(f"{fault}; a path is relative to this file") from None
    where = folder_of(base, folder)
    base = str(where / FilePath(base).name) if where else base
    so_far = (*(above or (name,)), str(FilePath(base).resolve()) if where else base)
    if so_far[-1] in above:
        raise refuse(f"runs in a circle: {' -> '.join(so_far)}")
    below, below_places = document(found, base, where, so_far, base)
    return _laid_over(below, data), _places_over(below_places, below, places, data)


def _places_over(
    base_places: Mapping[Path, Place],
    base: Mapping[str, Any],
    top_places: Mapping[Path, Place],
    top: Mapping[str, Any],
) -> dict[Path, Place]:
    """Where the keys of `_laid_over(base, top)` stand: what `top` replaces stands there alone."""
    replaced = set(_replaced(base, top))
    kept = {
        path: place
        for path, place in base_places.items()
        if not any(path[:i] in replaced for i in range(1, len(path) + 1))
    }
    return kept | dict(top_places)


def _replaced(base: Mapping[str, Any], top: Mapping[str, Any], at: Path = ()) -> Iterator[Path]:
    """The paths at which `top` takes the place of what `base` says."""
    for key, value in top.items():
        below = base.get(key)
        if isinstance(below, dict) and isinstance(value, dict) and _alike(below, value):
            yield from _replaced(below, value, (*at, key))
        else:
            yield (*at, key)


def with_family(
    data: dict[str, Any], name: str, places: Mapping[Path, Place], set_by: Mapping[Path, str]
) -> dict[str, Any]:
    """The scene with a linkage's `family` and `n` written out as bodies, joints and loops."""
    linkage = data.get("linkage")
    if not isinstance(linkage, dict) or "family" not in linkage:
        return data
    try:
        made = families.members(linkage)
    except families.FamilyError as error:
        option = f"--set {set_by[error.path]}" if error.path in set_by else None
        file, line = place_of(error.path, places)
        finding = Finding(".".join(map(str, error.path)), error.message, line, option, file)
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


def traced(data: Mapping[str, Any]) -> list[tuple[Path, dict[str, Any]]]:
    """[graphics] and [[fmu]] tables that say `rate = { trace = FILE }`, with their paths."""
    fmus = data.get("fmu")
    tables: list[tuple[Path, Any]] = [(("graphics",), data.get("graphics"))]
    tables += [(("fmu", i), f) for i, f in enumerate(fmus if isinstance(fmus, list) else ())]
    return [(path, t) for path, t in tables if isinstance(t, dict) and _is_trace(t.get("rate"))]


def _is_trace(rate: Any) -> bool:
    return isinstance(rate, dict) and rate.keys() == {"trace"} and isinstance(rate["trace"], str)
