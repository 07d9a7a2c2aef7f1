"""Runs the points in interleaved rounds, and compares each with the reference: the measured points,
and the Pareto front among them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from benchmarks.continuous import GRID, Reference
from benchmarks.cosimulation.points import NONE, Point
from benchmarks.page import Progress
from benchmarks.rows import Rows, quartiles
from benchmarks.timing import loop_timed_by
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.fmi import process_cache

SETTINGS = tuple(f.name for f in fields(Point))
COLUMNS = (*SETTINGS, "round", "run_s", "first_mm", "max_mm", "rms_mm", "end", "end_s")
APART = 42.0
"""Error (mm, the length of a link) from which on a run counts as unstable."""


REFUSED = "refused"
WORTH = 0.02
"""Errors within this share of each other count as equal on the front."""


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
        with loop_timed_by():
            made = simulate(point.scene, folder, options, csv=False)
    except InputFault:
        return ["", "", "", "", REFUSED, ""]
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
    with process_cache.keep_unpacked(), temporary_folders.temporary_folder() as room:
        for number in range(rounds):
            for k, point in enumerate(points):
                progress(str(point), number * len(points) + k, rounds * len(points))
                first = rows.rows.get((*point.key, "0"))
                if (*point.key, number) in rows or (first and first["end"] == REFUSED):
                    continue
                reference = references[point.scene].relative
                rows.add(*point.key, number, *run(point, reference, room))
    return rows


@dataclass(frozen=True)
class Measured:
    """A point; run times (s) of its rounds, and its errors (mm): the largest in the first second
    and over the run, the RMS over the run. Of an unstable run they go to its end."""

    point: Point
    times: tuple[float, ...]
    first: float
    most: float
    rms: float
    end: str

    @property
    def unstable(self) -> bool:
        """Whether the run ended early, or the handle left the reference by a link's length."""
        return self.end != "duration" or not self.most < APART

    @property
    def time(self) -> tuple[float, float, float]:
        """Quartiles of the run time (s)."""
        return quartiles(self.times)

    @property
    def kind(self) -> str:
        """The choice for which a figure has a colour."""
        point = self.point
        if point.model == "held":
            return "local model"
        if point.scheme not in ("gauss-seidel", "gauss-seidel-plants"):
            return point.scheme
        if point.frames == NONE:
            return "nothing held"
        return "held, zoh" if point.hold == "zoh" else "held, other holds"


def measured(rows: Rows, scene: str) -> list[Measured]:
    """The points of a scene, without those that were refused."""
    groups: dict[tuple[str, ...], list[dict[str, str]]] = {}
    for key, row in rows.rows.items():
        if row["scene"] == scene and row["end"] != REFUSED:
            groups.setdefault(key[:-1], []).append(row)
    return [_measured(key, of) for key, of in groups.items()]


def _measured(key: Sequence[str], of: Sequence[dict[str, str]]) -> Measured:
    kinds = {name: type(default) for name, default in asdict(Point()).items()}
    settings = {n: kinds[n](v) for n, v in zip(SETTINGS, key, strict=True)}
    first, most, rms = (float(of[0][name]) for name in ("first_mm", "max_mm", "rms_mm"))
    times = tuple(float(row["run_s"]) for row in of)
    return Measured(Point(**settings), times, first, most, rms, of[0]["end"])


def front(found: Iterable[Measured]) -> list[Measured]:
    """The stable points that no other beats in median run time and in largest error, from the
    fastest on; errors within WORTH of each other count as equal."""
    kept: list[Measured] = []
    for each in sorted((m for m in found if not m.unstable), key=lambda m: (m.time[1], m.most)):
        if not kept or each.most < (1 - WORTH) * kept[-1].most:
            kept.append(each)
    return kept
