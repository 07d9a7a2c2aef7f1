"""`hapticlink run`."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from hapticlink.commands.options import (
    Json,
    Out,
    Quiet,
    Scene,
    Set,
    Swap,
    default_folder,
    options,
    tell,
)
from hapticlink.commands.progress import progress
from hapticlink.orchestrator.base.faults import Fault
from hapticlink.orchestrator.base.terminal_output import say

if TYPE_CHECKING:
    from hapticlink.api.result import Run

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
    quiet: Quiet = False,
    json: Json = False,
) -> int:
    """Run a scene; write CSV files, run.json, plan.txt and figures to OUT (default
    `runs/SCENE`, with options `runs/SCENE,key=value,...`).

    A run replaces the results of an earlier one in its folder. The exit status is 0 for a regular
    end, 1 for a run that failed (results up to then are kept), 2 for bad input.

    For example:

        hapticlink run closed-loop
        hapticlink run closed-loop --set graphics.rate=10 --set hold=foh
        hapticlink run my-scene.toml --no-figures --json > result.json
    """
    import hapticlink as hl
    from hapticlink.analysis.findings import summary

    overrides = options(set, swap)
    if explain:
        say(*hl.explain(scene, overrides), sep="\n")
        return 0
    folder = out or default_folder("runs", scene, (*(set or ()), *(swap or ())))
    try:
        read = hl.scene(scene, overrides)
        with progress(read.title, read.duration, hidden=quiet) as report:
            result = hl.run(read, out=folder, figures=figures, progress=report, real_time=real_time)
    except hl.RunInterrupted as ended:
        result = ended.run
    if result.fault:
        say(f"hapticlink: {result.fault}", file=sys.stderr)
    warnings = result.run.get("warnings")
    if warnings is None:  # no row is in the folder
        warnings = list(summary.lines(result))
    if quiet or json:
        for line in warnings:
            say(f"hapticlink: {line}", file=sys.stderr)
    name = default_folder("runs", scene).name
    tell(_lines(result, warnings, name, folder), result.run, quiet, json)
    return Fault.exit_status if result.fault else 0


def _lines(result: Run, warnings: Sequence[str], name: str, folder: Path) -> Iterator[str]:
    from hapticlink.analysis.findings import summary
    from hapticlink.orchestrator.results.tables import TABLES

    yield f"{name}: {summary.ending(result)}"
    for line in (*result.numbers, *warnings):
        yield f"  {line}"
    wall_time = result.run["timings"]["run"]
    if wall_time:  # none where a signal came before the first event
        speed = result.run["end"]["time"] / wall_time
        yield f"  {wall_time:.2f} s of run time, {speed:.1f} times real time"
    if result.folder:
        names = sorted(result.run["files"], key=lambda name: not name.endswith(TABLES))
        yield f"  {folder}/: {', '.join(names)}"
    else:
        yield f"  {folder}/: nothing written, the run failed before the first sample"
