from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands import progress
from hapticlink.commands.options import (
    PRINTED,
    UNCHANGED,
    Format,
    Output,
    Scene,
    SceneOptions,
    default_folder,
    title,
)
from hapticlink.orchestrator.base.terminal_output import say

Vary = Annotated[
    list[str] | None,
    Parameter(
        consume_multiple=False,
        negative="",
        help="key=values, repeatable: every combination is run. Values are separated by commas; "
        "a..b is every whole number from a to b, a..b..step has that step, a..b:n has n evenly "
        "spaced points. E.g. --vary graphics.rate=10..60..10 --vary hold=zoh,lead,foh",
    ),
]
Runs = Annotated[
    Path | None,
    Parameter(
        help="Instead of --vary, a list of runs: a CSV with a column per key, or a TOML of [[run]]."
    ),
]
Repeat = Annotated[
    int,
    Parameter(
        help="Runs of each point, with other seeds of what is drawn (rates that vary, latency and "
        "loss, noise); spread.csv then has medians and quartiles."
    ),
]
Jobs = Annotated[int | None, Parameter(help="Runs at a time; default one per processor.")]
Scheduler = Annotated[
    str | None, Parameter(help="Address of a Dask scheduler to run on, e.g. tcp://10.0.0.5:8786.")
]
Metric = Annotated[str | None, Parameter(help="The column of table.csv that the figure shows.")]


def sweep(
    scene: Scene,
    /,
    *,
    vary: Vary = None,
    runs: Runs = None,
    repeat: Repeat = 1,
    changes: SceneOptions = UNCHANGED,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    metric: Metric = None,
    format: Format = "png",
    output: Output = PRINTED,
) -> int:
    """Run many variants of a scene in parallel; write table.csv and sweep.png to OUT (default
    sweeps/SCENE).

    A run that fails is a row of the table. The exit status is 2 if every run is refused, 1 if every
    run fails. An interrupted sweep is continued by the same command; finished runs are not
    repeated.

    For example:

        hapticlink sweep closed-loop-direct --vary graphics.rate=10..60..10 --vary hold=zoh,lead,foh
        hapticlink sweep closed-loop --vary graphics.rate=10..60:11 --metric tracking_max_mm
        hapticlink sweep scenario --vary hold=zoh,foh --repeat 20
    """
    import hapticlink as hl
    from hapticlink.analysis.sweep.row import REFUSED
    from hapticlink.orchestrator.base.errors import InputFault

    folder = output.out or default_folder("sweeps", scene)
    with progress.runs(f"{title(scene)}: sweep", output.quiet) as count:
        result = hl.sweep(
            scene, vary or (), changes.options, runs=runs or (), repeat=repeat, out=folder,
            jobs=jobs, scheduler=scheduler, metric=metric, format=format, progress=count,
        )  # fmt: skip
    for row in result.failed[:10]:
        what = ", ".join(f"{k}={v}" for k, v in row.items() if k in result.keys)
        say(f"hapticlink: {what}: {row['end']}: {row['message']}", file=sys.stderr)
    runs_done, failed = len(result.rows), len(result.failed)
    record = {"folder": str(folder), "rows": result.rows}
    record |= {"spread": spread} if (spread := result.spread) else {}
    output.show(f"{title(scene)}: {result}", [f"{folder}/: {', '.join(result.files)}"], record)
    if failed < runs_done:
        return 0
    return InputFault.exit_status if all(r["end"] == REFUSED for r in result.rows) else 1
