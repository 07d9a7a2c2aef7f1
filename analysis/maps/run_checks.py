"""Points of a map at which runs of the FMUs check its verdict, chosen with a seed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from hapticlink.analysis.findings.tracking import table_of
from hapticlink.analysis.maps.boundary_lines import COLUMNS, Line, judged, line
from hapticlink.analysis.stability.scene_variants import SceneVariants
from hapticlink.analysis.sweep.grid import Point
from hapticlink.analysis.sweep.row import DONE, Row
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.blas_threads import one_blas_thread
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.signal_names import JOINT_RATES, POINT_VELOCITY
from hapticlink.orchestrator.experiment import simulate
from hapticlink.orchestrator.scene.scene import Scene

BAND, FAR = 0.02, 0.06
"""Points next to a boundary lie off it by more than the first and up to the second, relative."""
SPANS = 8.0
"""Time constants of the leading mode over which the growth rate of a run is taken."""
SHORTEST, LONGEST = 2.0, 30.0
"""Times (s) of a run, the longer one that of its verdict."""
MOVING = (JOINT_RATES, POINT_VELOCITY)
GONE = 1e-9
"""Velocity, relative to the largest of the run, that is taken for rest."""


def chosen(rows: Sequence[Row], count: int, seed: int) -> list[Point]:
    """`count` points: half of them next to the boundary, to both sides, and half anywhere on the
    grid, as many as there are, drawn by numpy's PCG64 with `seed`."""
    generator = np.random.Generator(np.random.PCG64(seed))
    edge = [row for row in rows if row.get("at") == "boundary"]
    grid = [row for row in rows if row.get("at") == "grid" and row["verdict"] != "refused"]
    found: list[Point] = []
    near = min(count // 2, 2 * len(edge)) if edge else 0
    for i in generator.permutation(2 * len(edge))[:near]:
        row = edge[i // 2]
        off = generator.uniform(1.1 * BAND, FAR) * (1 if i % 2 else -1)
        point = _point(row)
        key = row["along"]
        found.append(point | {key: f"{float(point[key]) * (1 + off):.6g}"})
    for i in generator.permutation(len(grid))[: count - near]:
        found.append(_point(grid[i]))
    return found


def _point(row: Row) -> Point:
    return {k: v for k, v in row.items() if k not in COLUMNS}


def jobs(scene: str | Path | Scene, options: Sequence[str], points: Sequence[Point]) -> list[Line]:
    """The checks of the points at which the scene is not refused."""
    made = []
    for point in points:
        with suppress(InputFault):
            made.append(line(scene, options, point))
    return made


@one_blas_thread()
def judge(each: Line, _: Path) -> Row:
    """The row of a check: the map's verdict, and that of a run of the scene."""
    assert each.scene is not None
    with SceneVariants(each.scene) as session:
        row = judged(session, "check", [])
    if "growth_rate" not in row:
        return {"end": DONE, "rows": [row]}
    rate, verdict = of_run(each.scene, row["growth_rate"])
    row |= {"run_growth_rate": rate, "run_verdict": verdict}
    return {"end": DONE, "rows": [row | {"agree": row["run_verdict"] == row["verdict"]}]}


def of_run(scene: Scene, foretold: float) -> tuple[float, str]:
    """Growth rate (1/s) and verdict of a run of LONGEST. It is stable if its motion decays over the
    whole of it: by a factor e, or half as fast as a map has `foretold` if that is slower. One that
    keeps its size is an instability that ended in a limit cycle, as where motors saturate. The rate
    is that of the first SPANS time constants of what was foretold, within the limits, or of the
    whole where the motion changes by less than a factor e before; infinite if the run ends before.
    """
    speed, whole = _speeds(scene)
    seconds = min(LONGEST, max(SHORTEST, SPANS / max(abs(foretold), 1e-9)))
    samples = math.ceil(seconds / LONGEST * whole)
    rate = growth(speed[:samples], seconds) if len(speed) >= samples else np.inf
    at_last = growth(speed, LONGEST) if len(speed) >= whole else np.inf
    verdict = "stable" if at_last < -min(1 / LONGEST, abs(foretold) / 2) else "unstable"
    return rate if abs(rate) * seconds >= 1.0 else at_last, verdict


def growth(speed: Vector, seconds: float) -> float:
    """The growth rate (1/s) of evenly spaced speeds within `seconds` between their second and last
    quarter, or their first and last if that is larger; that of rest minus infinite."""
    first, early, _, late = np.array_split(speed, 4)
    if late.max() <= GONE * speed.max():
        return -np.inf
    rates = (
        np.log(late.max() / since.max()) / (part * seconds)
        for since, part in ((early, 0.5), (first, 0.75))
    )
    return float(max(rates))


def _speeds(scene: Scene) -> tuple[Vector, int]:
    """The largest of the mechanism's velocities at each sample of a run of LONGEST, up to its end,
    and how many samples a whole one has."""
    with temporary_folders.temporary_folder() as room:
        experiment = simulate(open_scene.load(scene, [f"duration={LONGEST:g}"]), room)
        results = experiment.results
        signal = next(s for s in MOVING if table_of(results, s) is not None)
        table = table_of(results, signal)
        assert table is not None
        speed = np.abs(table[signal]).max(axis=1)
        if not speed.any():
            raise InputFault("a run from rest shows no growth: give the scene a start off its rest")
        if experiment.outcome.reason in ("duration", "stop_when"):
            return speed, len(speed)
        return speed, math.ceil(LONGEST * len(speed) / max(float(table["time"][-1]), 1e-9)) + 1
