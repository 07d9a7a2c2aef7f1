"""Maps the stability of a scene."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hapticlink.analysis.maps.stability_map import Map, compute_map
from hapticlink.analysis.maps.z_width import compute_z_width
from hapticlink.analysis.sweep.grid import Vary, axes
from hapticlink.analysis.sweep.row import Row
from hapticlink.analysis.sweep.run_sweep import Means
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.process import count_processes
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.visualization import figure_files


def stability_map(
    scene: str | Path | Scene,
    vary: Vary,
    options: Options = (),
    *,
    out: str | Path,
    jobs: int | None = None,
    check: int = 0,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Map:
    """The stability of a scene over one or two keys of numbers, and any others (`vary`, as in
    `sweep`), from the linearised map of its co-simulation.

    The boundary is followed by bisection between neighbours with different verdicts, along every
    numeric key but rates. `check` points, half of them off the boundary by 2 to 6 %, are chosen by
    `seed` and run. Writes map.csv, after each line of points, and map.png to `out`; the same call
    continues an interrupted map. `jobs` is the number of processes; `progress` is
    called with the numbers of finished and of all lines of points. Raises InputFault for invalid
    input, Fault if the map is interrupted.
    """
    from hapticlink.visualization.figures import stability_map_figure as drawing

    if check < 0:
        raise InputFault(f"--check {check}: give 0 or more")
    means = Means(folders.ensure(out), count_processes(jobs), progress)
    found = compute_map(scene, overrides.write_options(options), axes(vary), means, check, seed)
    figure_files.save({"map": drawing.draw(found)}, means.folder)
    return found


def z_width(
    scene: str | Path | Scene,
    largest: str,
    vary: Vary,
    options: Options = (),
    *,
    out: str | Path,
    jobs: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Row]:
    """The largest value of a key with which a scene is stable in its own hand, and with which its
    user's port is passive, at each combination of `vary` (as in `sweep`): a row for each, with
    `largest_stable`, `largest_passive` and how each search ended, in `stable` and `passive`
    ("limit", "at least", "none" or "refused"). `largest` is `key=value`, where the search begins,
    e.g. "fmu.wall.start.stiffness=1000"; a list is scaled as a whole, and told by its first entry.
    Walls with counts also have `largest_without_cycles`, and `cycle_m` (m) and `cycle_hz` of the
    longest limit cycle between two counts at the first value.

    Writes z-width.csv and z-width.png to `out`; the same call continues an interrupted one. `jobs`
    is the number of processes; `progress` is called with the numbers of finished and of all
    points. `options` are those of the scene. Raises InputFault for
    invalid input, Fault if it is interrupted.
    """
    from hapticlink.visualization.figures import z_width_figure as drawing

    means, over = Means(folders.ensure(out), count_processes(jobs), progress), axes(vary)
    rows = compute_z_width(scene, overrides.write_options(options), largest, over, means)
    drawn = drawing.draw(rows, largest.partition("=")[0], over)
    figure_files.save({"z-width": drawn}, means.folder)
    return rows
