"""One run of a sweep, and the key under which its row is stored."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from platform import python_version
from typing import Any

from pydantic_core import to_json

import hapticlink.analysis
import hapticlink.components
import hapticlink.fmus
import hapticlink.orchestrator
from hapticlink.analysis.sweep.repeats import REPETITION
from hapticlink.analysis.sweep.repeats import repeat as repeated
from hapticlink.fmus.cache import sources
from hapticlink.fmus.versions import version
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt, plugins
from hapticlink.orchestrator.base.errors import Fault, InputFault
from hapticlink.orchestrator.describe_run import PACKAGES
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_source import Source


@dataclass(frozen=True)
class Job:
    """A point of a sweep. scene: the checked scene, None if it was refused; then `refusal` says
    why. plugins: the modules that it may need."""

    point: Mapping[str, str]
    scene: Scene | None
    key: str = ""
    refusal: str = ""
    plugins: tuple[str, ...] = ()


def jobs(
    scene: str | Path | Scene,
    options: Sequence[str],
    points: Iterable[Mapping[str, str]],
    repeat: int = 1,
) -> list[Job]:
    """The jobs of `points`, each of `scene` with the common `options` and those of its point, and
    `repeat` times with other seeds.

    A point without a valid scene is a refused job. Raises InputFault if all points are refused or
    there is no such scene, and as `repeats.repeat`; Interrupted for a signal.
    """
    source = open_scene.source_of(scene)

    def at(point: Mapping[str, str]) -> Job:
        own = (f"{k}={v}" for k, v in point.items() if k != REPETITION)
        return job(source, [*options, *own], point)

    checked = [at(point) for point in points]
    if checked and all(one.scene is None for one in checked):
        raise InputFault(checked[0].refusal)
    if repeat > 1:
        checked = [at(p) for p in repeated([(j.point, j.scene) for j in checked], repeat)]
    return checked


def job(
    scene: str | Path | Scene | Source, options: Sequence[str], point: Mapping[str, str]
) -> Job:
    """The job of `scene` with `options`, listed in the table as `point`. Raises Interrupted for a
    signal."""
    interrupt.raise_if_interrupted()  # 100,000 points take minutes
    try:
        loaded = open_scene.load(scene, options, takes=open_scene.BEGINNINGS)
        return Job(point, loaded, key(loaded), plugins=tuple(plugins.list_plugins()))
    except Fault as fault:
        return Job(point, None, refusal=str(fault))


def key(scene: Scene) -> str:
    """SHA-256 of everything that a run depends on: the resolved scene, its FMU files, versions and
    sources, also those of plugins. Raises InputFault for an FMU file that cannot be read."""
    computed_with = [*_list_code(), plugins.list_plugins()]
    whole: dict[str, Any] = {"scene": scene.plain(), "made_with": computed_with}
    try:
        paths = [Path(path) for path in (scene.resume, *(f.path for f in scene.fmu)) if path]
        files = [sha256(path.read_bytes()).hexdigest() for path in paths]
    except OSError as error:
        raise InputFault(f"{error.filename}: cannot be read: {error.strerror}") from error
    return sha256(to_json(whole | {"fmus": files}, inf_nan_mode="constants")).hexdigest()


@cache
def _list_code() -> list[str]:
    """What computes a row: Python, packages and sources, in C too, but nothing that only draws."""
    code = sources(
        hapticlink.components, hapticlink.fmus, hapticlink.orchestrator, hapticlink.analysis
    )
    return [python_version(), *(version(name) for name in PACKAGES), code]
