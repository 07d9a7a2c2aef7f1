"""`hapticlink sweep`."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.commands.options import Out, Scene, Set, default_folder

Vary = Annotated[
    list[str] | None,
    Parameter(
        name="--vary",
        consume_multiple=False,
        negative="",
        help="key=values, repeatable: every combination is run. Values stand between commas; "
        "a..b is every whole number from a to b, a..b..step goes in steps, a..b:n spreads n "
        "points evenly. E.g. --vary graphics.rate=10..60..10 --vary hold=zoh,lead,foh",
    ),
]
Runs = Annotated[
    Path | None,
    Parameter(
        help="In place of --vary, a list of runs: a CSV with a column a key, or a TOML of [[run]]."
    ),
]
Jobs = Annotated[int | None, Parameter(help="Runs at a time; default one a processor.")]
Scheduler = Annotated[
    str | None, Parameter(help="Address of a Dask scheduler to run on, e.g. tcp://10.0.0.5:8786.")
]
Metric = Annotated[str | None, Parameter(help="The figure's column of table.csv.")]


def sweep(
    scene: Scene,
    /,
    *,
    vary: Vary = None,
    runs: Runs = None,
    out: Out = None,
    set: Set = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    metric: Metric = None,
) -> int:
    """Run many variants of a scene in parallel; write table.csv and sweep.png to OUT (default
    sweeps/<scene>).

    A run that fails is a row of the table; where every run is refused the exit status is 2, where
    every run fails 1. A sweep that is interrupted goes on where it was when
    it is called again; runs made before are not made twice.
    """
    from hapticlink.orchestrator.base.faults import InputFault
    from hapticlink.orchestrator.commands.progress import counted
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.sweep import figure, grid, job, row
    from hapticlink.orchestrator.sweep import sweep as make

    if bool(vary) == bool(runs):
        raise InputFault("sweep: give --vary key=values (repeatable) or --runs FILE")
    if jobs is not None and jobs < 1:
        raise InputFault(f"--jobs {jobs}: give 1 or more")
    points = grid.listed(runs) if runs else grid.grid([grid.parse(text) for text in vary or ()])
    made = job.jobs(scene, set or (), points)
    if metric:
        figure.check(metric, [j.scene for j in made if j.scene])
    folder = folders.made(out or default_folder("sweeps", scene))
    with counted(scene, len(made)) as tell:
        rows = make(made, folder, jobs or os.cpu_count() or 1, scheduler, tell)
    keys = list(dict.fromkeys(k for p in points for k in p))
    failed = [r for r in rows if r["end"] in row.FAILED]
    for each in failed[:10]:
        what = ", ".join(f"{k}={v}" for k, v in each.items() if k in keys)
        print(f"hapticlink: {what}: {each['end']}: {each['message']}", file=sys.stderr)
    print(f"{default_folder('sweeps', scene).name}: {len(rows)} runs, {len(failed)} of them failed")
    drawn = figure.draw(rows, keys, folder, metric)
    print(f"  {folder}/: table.csv{', ' if drawn else ''}{drawn or ''}")
    if len(failed) < len(rows):
        return 0
    return InputFault.exit_status if all(r["end"] == row.REFUSED for r in rows) else 1
