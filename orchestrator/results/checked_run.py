"""What run.json says of a run, checked before pages and comparisons are made of it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter, ValidationError

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.results.scene_part import first_error
from hapticlink.orchestrator.results.tables import Results, load


@dataclass(frozen=True)
class _Scene:
    title: str


@dataclass(frozen=True)
class _Clock:
    shortest: float
    longest: float


@dataclass(frozen=True)
class _End:
    reason: str
    time: float | None = None


@dataclass(frozen=True)
class _Fault:
    message: str


@dataclass(frozen=True)
class _Age:
    min: float
    max: float


@dataclass(frozen=True)
class _Energy:
    generated: float
    peak: float


@dataclass(frozen=True)
class _Errors:
    sum: float


@dataclass(frozen=True)
class _Iterations:
    steps: int
    unconverged: int


@dataclass(frozen=True)
class _Timings:
    run: float | None = None


@dataclass(frozen=True)
class _Told:
    """What pages and comparisons read of run.json; with a default, what a run has that has ended,
    but not one that goes on or was killed."""

    scene: _Scene
    rates: list[str]
    fmus: dict[str, dict[str, Any]]
    clocks: dict[str, _Clock]
    versions: dict[str, str]
    options: list[str]
    connections: list[str]
    holds: dict[str, str]
    stop_when: str
    end: _End
    fault: _Fault | None = None
    warnings: Sequence[str] = ()
    not_recorded: Sequence[str] = ()
    delays: dict[str, _Age] = field(default_factory=dict)
    energies: dict[str, _Energy] | Literal["none"] = "none"
    energies_within_a_rate: dict[str, _Energy] = field(default_factory=dict)
    step_errors: dict[str, _Errors] = field(default_factory=dict)
    iterations: _Iterations | None = None
    timings: _Timings = _Timings()
    real_time: dict[str, Any] | None = None


def load_whole(folder: Path | str) -> Results:
    """Reads a run's folder. Raises InputFault if it contains no run, or one whose run.json is of
    another version, or was changed."""
    results = load(folder)
    try:
        TypeAdapter(_Told).validate_python(results.run)
    except ValidationError as error:
        raise InputFault(f"{folder}/run.json: {first_error(error)}: run the scene again") from error
    return results


def named(folders: Sequence[Path | str]) -> dict[str, Results]:
    """The runs of folders by the names that tell those apart. Raises InputFault as `load_whole`,
    and for a folder that is named twice."""
    return dict(zip(names(folders), map(load_whole, folders), strict=True))


def names(folders: Sequence[Path | str]) -> list[str]:
    """What tells folders apart: their last part, or all parts behind what they have in common.
    Raises InputFault for one that is named twice."""
    paths = [Path(folder).resolve() for folder in folders]
    if twice := next((f for i, f in enumerate(folders) if paths[i] in paths[:i]), None):
        raise InputFault(f"{twice}: is named twice")
    if len({path.name for path in paths}) == len(paths):
        return [path.name for path in paths]
    common = os.path.commonpath(paths)
    return [path.relative_to(common).as_posix() for path in paths]
