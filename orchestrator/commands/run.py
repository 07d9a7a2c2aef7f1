"""`hapticlink run`."""

from __future__ import annotations

import sys
from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.base.faults import Fault
from hapticlink.orchestrator.base.say import say
from hapticlink.orchestrator.commands.options import Out, Scene, Set, Swap, default_folder, options
from hapticlink.orchestrator.commands.progress import progress

Figures = Annotated[bool, Parameter(help="Draw figures, which takes longer than many runs do.")]
Explain = Annotated[
    bool, Parameter(negative="", help="Print what would run when, from which samples; do not run.")
]
RealTime = Annotated[
    bool,
    Parameter(
        negative="",
        help="Pace the haptic loop by the wall clock, with FMUs of other rates beside it.",
    ),
]


def run(
    scene: Scene,
    /,
    *,
    out: Out = None,
    set: Set = None,
    swap: Swap = None,
    figures: Figures = True,
    explain: Explain = False,
    real_time: RealTime = False,
) -> int:
    """Run a scene; write CSV files, run.json, plan.txt, figures to OUT (default runs/<scene>)."""
    from hapticlink.orchestrator import api
    from hapticlink.orchestrator.results import summary
    from hapticlink.orchestrator.results.tables import TABLES

    if explain:
        say(*api.explain(scene, options(set, swap)), sep="\n")
        return 0
    folder = out or default_folder("runs", scene)
    try:
        read = api.scene(scene, options(set, swap))
        with progress(read.title, read.duration) as told:
            made = api.run(read, out=folder, figures=figures, progress=told, real_time=real_time)
    except api.RunInterrupted as ended:
        made = ended.run
    if made.fault:
        say(f"hapticlink: {made.fault}", file=sys.stderr)
    say(f"{default_folder('runs', scene).name}: {summary.ending(made)}")
    for line in (*summary.numbers(made), *summary.lines(made)):
        say(f"  {line}")
    wall_time = made.run["timings"]["run"]
    if wall_time:  # none where a signal came before the first event
        speed = made.run["end"]["time"] / wall_time
        say(f"  {wall_time:.2f} s of run time, {speed:.1f} times real time")
    if made.folder:
        names = sorted(made.run["files"], key=lambda name: not name.endswith(TABLES))
        say(f"  {folder}/: {', '.join(names)}")
    else:
        say(f"  {folder}/ is unchanged: the run has no row")
    return Fault.exit_status if made.fault else 0
