"""Maps of stability: the verdict over two varied keys, refined at the boundary, and checked by
runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hapticlink.analysis.maps import boundary_lines, run_checks
from hapticlink.analysis.maps.boundary_lines import Line
from hapticlink.analysis.sweep.grid import Axis, grid
from hapticlink.analysis.sweep.pool import keep_processes
from hapticlink.analysis.sweep.row import Row
from hapticlink.analysis.sweep.run_sweep import Judge, Means, tabulate
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.errors import InputFault
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


@interrupt.defer_signals()
@keep_processes()
def compute_map(
    scene: str | Path | Scene,
    options: Sequence[str],
    axes: Sequence[Axis],
    means: Means,
    check: int = 0,
    seed: int = 0,
) -> Map:
    """The map over `axes`: the first two of numbers are its plane, the others give panels. Along
    both keys, each pair of neighbours with different verdicts is followed to where the radius is
    1.

    A line of points is kept in `rows` of the folder when it is done, after which map.csv has it
    too; the same call continues an interrupted map. Raises Unfinished if it is interrupted,
    InputFault without an axis of numbers.
    """
    numeric = [axis for axis in axes if axis.is_scale]
    if not numeric:
        raise InputFault(
            "--vary: no key has two numbers or more; give one or two such keys, e.g. "
            "--vary fmu.wall.start.stiffness=1000..6000:11"
        )
    plane = numeric[:2]
    others = [axis for axis in axes if axis not in plane]
    x, y = plane[0], plane[1] if len(plane) == 2 else None
    panels = grid(others)

    def add(lines: Sequence[Line], judge: Judge, before: Sequence[Row]) -> list[Row]:
        return tabulate(lines, means, judge, before=before, name="map.csv", each_time=True)

    lines = [
        line
        for panel in panels
        for line in boundary_lines.along(scene, options, panel, y or x, y and x)
    ]
    rows = add(lines, boundary_lines.judge, ())
    if y:
        across = boundary_lines.across(scene, options, rows, x, y)
        rows = add(across, boundary_lines.judge, rows)
    if check:
        points = run_checks.chosen(rows, check, seed)
        rows = add(run_checks.jobs(scene, options, points), run_checks.judge, rows)
    first = open_scene.load(scene, options)
    return Map(first, rows, x.key, y.key if y else None, tuple(a.key for a in others))
