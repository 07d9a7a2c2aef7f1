"""`hapticlink run`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.base.faults import Interrupted
from hapticlink.orchestrator.commands.options import Out, Scene, Set, default_folder

if TYPE_CHECKING:
    from hapticlink.orchestrator.experiment import Experiment

Explain = Annotated[
    bool, Parameter(negative="", help="Print what runs when, from which samples; run nothing.")
]


def run(scene: Scene, /, *, out: Out = None, set: Set = None, explain: Explain = False) -> int:
    """Run a scene: results as CSV, run.json, plan.txt and figures in OUT (default runs/<scene>)."""
    if explain:
        return _explain(scene, set or ())
    folder = out or default_folder("runs", scene)
    try:
        experiment = _simulate(scene, folder, set or ())
    except KeyboardInterrupt:  # a run takes those that come while it goes on
        raise Interrupted from None
    from hapticlink.orchestrator.plan import explain as explained
    from hapticlink.orchestrator.plan.plan import Plan
    from hapticlink.orchestrator.results import folders, summary

    outcome = experiment.outcome
    if outcome.fault:
        print(f"hapticlink: {outcome.fault}", file=sys.stderr)
    others = []
    if outcome.end_time > 0:
        from hapticlink.orchestrator.results.figures import draw

        with (experiment.folder / "plan.txt").open("w", encoding="utf-8") as file:
            file.writelines(f"{line}\n" for line in explained.explain(Plan(experiment.system)))
        others = ["plan.txt", *draw(experiment.results)]
        folders.add(experiment.folder, others)
    speed = outcome.end_time / outcome.wall_time
    ends = {"stop_when": f"ended by {experiment.system.ends_when}", "duration": "done"}
    how = ends.get(outcome.reason, outcome.reason)
    print(f"{default_folder('runs', scene).name}: {how} at {outcome.end_time:.6g} s")
    for line in summary.lines(experiment.results):
        print(f"  {line}")
    print(f"  {outcome.wall_time:.2f} s of run time, {speed:.1f} times real time")
    tables = (f"{clock.name}.csv" for clock in experiment.system.timeline.clocks)
    print(f"  {folder}/: {', '.join([*tables, 'run.json', *others])}")
    return outcome.fault.exit_status if outcome.fault else 0


def _simulate(scene: str, folder: Path, options: Sequence[str]) -> Experiment:
    from hapticlink.orchestrator import open_scene
    from hapticlink.orchestrator.commands.progress import progress
    from hapticlink.orchestrator.experiment import simulate

    read = open_scene.load(scene, options)
    with progress(read.title, read.duration) as told:
        return simulate(read, folder, options, told)


def _explain(scene: str, options: Sequence[str]) -> int:
    """Print the plan of a run, and run nothing."""
    from hapticlink.orchestrator import open_scene
    from hapticlink.orchestrator.base import temporary_folders
    from hapticlink.orchestrator.plan import explain
    from hapticlink.orchestrator.plan.plan import Plan
    from hapticlink.orchestrator.system.assemble import from_scene
    from hapticlink.orchestrator.system.fmu_files import fmu_files
    from hapticlink.orchestrator.system.timeline import timeline

    read = open_scene.load(scene, options)
    with temporary_folders.room() as room:
        time = timeline(read)
        system = from_scene(read, time, fmu_files(read, time, room))
        for line in explain.explain(Plan(system), explain.PRINTED):
            print(line)
    return 0
