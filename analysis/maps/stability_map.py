"""Maps of stability: the verdict over two varied keys, refined at the boundary, and checked by
runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from hapticlink.analysis.maps import boundary_lines, run_checks
from hapticlink.analysis.maps.boundary_lines import DONE
from hapticlink.analysis.sweep import pool, table
from hapticlink.analysis.sweep.grid import Axis, number
from hapticlink.analysis.sweep.job import Job
from hapticlink.analysis.sweep.row import Row
from hapticlink.analysis.sweep.run_sweep import Unfinished
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import InputFault, Interrupted
from hapticlink.orchestrator.scene.scene import Scene


@dataclass(frozen=True)
class Map:
    """The rows of a map. x, y: the keys of its plane; panels: the others. Columns of a row: the
    keys, `at` ("grid", "boundary" or "check"), spectral radius, growth rate (1/s), verdict; of a
    check also the growth in the run, its verdict, and whether both `agree`."""

    scene: Scene
    rows: list[Row]
    x: str
    y: str | None
    panels: tuple[str, ...]

    def of(self, at: str) -> list[Row]:
        return [row for row in self.rows if row.get("at") == at]


def compute_map(
    scene: str | Path | Scene,
    options: Sequence[str],
    axes: Sequence[Axis],
    folder: Path,
    processes: int,
    check: int = 0,
    seed: int = 0,
    tell: Callable[[int, int], None] = lambda done, of: None,
) -> Map:
    """The map over `axes`: the first two of numbers are its plane, the others give panels. Along
    both keys, each pair of neighbours with different verdicts is followed to where the radius is
    1.

    A line of points is kept in `folder`/rows when it is done, after which map.csv has it too; the
    same call continues an interrupted map. Raises Unfinished if it is interrupted, InputFault
    without an axis of numbers.
    """
    numeric = [axis for axis in axes if _numeric(axis)]
    if not numeric:
        raise InputFault(
            "--vary: no key has two numbers or more; give one or two such keys, e.g. "
            "--vary fmu.wall.start.stiffness=1000..6000:11"
        )
    plane = numeric[:2]
    others = [axis for axis in axes if axis not in plane]
    x, y = plane[0], plane[1] if len(plane) == 2 else None
    panels = [dict(zip((a.key for a in others), v, strict=True)) for v in _combined(others)]
    keep = _Kept(folder, tell)
    with interrupt.held():
        rows = keep.all(
            [
                line
                for panel in panels
                for line in boundary_lines.along(scene, options, panel, y or x, y and x)
            ],
            boundary_lines.work,
            processes,
        )
        if y:
            rows = keep.all(
                boundary_lines.across(scene, options, rows, x, y), boundary_lines.work, processes
            )
        if check:
            points = run_checks.chosen(rows, check, seed)
            rows = keep.all(run_checks.jobs(scene, options, points), run_checks.work, processes)
    first = open_scene.load(scene, options)
    return Map(first, rows, x.key, y.key if y else None, tuple(a.key for a in others))


class _Kept:
    """Does jobs that are not done yet, and writes the rows of all."""

    def __init__(self, folder: Path, tell: Callable[[int, int], None]) -> None:
        self._folder, self._tell = folder, tell
        self._rows = table.Rows(folder / "rows")
        self._done: list[Row] = []

    def all(self, jobs: Sequence[Job], work: Callable[[Any], Row], processes: int) -> list[Row]:
        """The rows of all jobs so far. A job that failed for a reason other than its scene is
        repeated by the next call."""
        found = {j.key: kept for j in jobs if (kept := self._rows.find(j.key))}
        missing = list({j.key: j for j in jobs if j.key not in found}.values())
        try:
            for each, row in pool.in_processes(work, missing, processes):
                if row["end"] == DONE:
                    self._rows.keep(each.key, row)
                found[each.key] = row
                self._tell(len(found), len(jobs))
                self._write(jobs, found)
        except Interrupted:
            raise Unfinished(len(found), len(jobs), self._folder, "map.csv") from None
        self._done = self._write(jobs, found)
        return self._done

    def _write(self, jobs: Sequence[Job], found: dict[str, Row]) -> list[Row]:
        rows = [*self._done]
        for each in jobs:
            for row in found.get(each.key, {"rows": ()}).get("rows", (found.get(each.key),)):
                rows.append({**each.point, **row})
        table.write(self._folder / "map.csv", rows)
        return rows


def _numeric(axis: Axis) -> bool:
    return len(axis.values) > 1 and all(number(value) is not None for value in axis.values)


def _combined(axes: Sequence[Axis]) -> list[tuple[str, ...]]:
    return list(product(*(axis.values for axis in axes)))
