"""Runs the points in interleaved rounds, and compares each with the reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np

from benchmarks.continuous import GRID, Reference
from benchmarks.cosimulation.points import Point
from benchmarks.page import Progress
from benchmarks.rows import Rows
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi import process_cache

SETTINGS = tuple(f.name for f in fields(Point))
COLUMNS = (*SETTINGS, "round", "run_s", "first_mm", "max_mm", "rms_mm", "end", "end_s")
APART = 42.0
"""Error (mm, the length of a link) from which on a run counts as unstable."""


def errors(handle: np.ndarray, reference: np.ndarray) -> tuple[float, float, float]:
    """Distances (mm) of the handle (k, 2) from the reference: the largest in the first second and
    over the run, and the RMS over the run."""
    apart = 1e3 * np.linalg.norm(handle - reference[: len(handle)], axis=1)
    rms = float(np.sqrt(np.mean(apart**2)))
    return float(apart[: GRID + 1].max()), float(apart.max()), rms


def run(point: Point, reference: np.ndarray, folder: Path, duration: float | None = None) -> list:
    """The row of a point from `run_s` on; a refused one has no numbers."""
    options = point.options + ([f"duration={duration!r}"] if duration else [])
    try:
        made = simulate(point.scene, folder, options, csv=False)
    except InputFault:
        return ["", "", "", "", "refused", ""]
    outcome = made.outcome
    handle = made.results.haptics["haptic_device.x_true"][:, :2]
    return [outcome.wall_time, *errors(handle, reference), outcome.reason, outcome.end_time]


def measure(
    path: Path,
    points: Sequence[Point],
    references: Mapping[str, Reference],
    rounds: int,
    progress: Progress,
) -> Rows:
    """Run what `path` lacks. All points of a round come before the next round, so that a busy
    machine slows all of them alike; a refused point is not asked again."""
    rows = Rows(path, COLUMNS, keys=len(SETTINGS) + 1)
    with process_cache.unpacked_once(), temporary_folders.room() as room:
        for number in range(rounds):
            for k, point in enumerate(points):
                progress(str(point), number * len(points) + k, rounds * len(points))
                first = rows.rows.get((*point.key, "0"))
                if (*point.key, number) in rows or (first and first["end"] == "refused"):
                    continue
                reference = references[point.scene].relative
                rows.add(*point.key, number, *run(point, reference, room))
    return rows
