"""`hapticlink run`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.commands.options import Out, Scene, Set, default_folder

Explain = Annotated[
    bool, Parameter(negative="", help="Print what runs when, from which samples; run nothing.")
]


def run(scene: Scene, /, *, out: Out = None, set: Set = None, explain: Explain = False) -> int:
    """Run a scene: results as CSV, run.json, plan.txt and figures in OUT (default runs/<scene>)."""
    if explain:
        return _explain(scene, set or ())
    from hapticlink.orchestrator import explain as explained
    from hapticlink.orchestrator import scene_file
    from hapticlink.orchestrator.commands.progress import progress
    from hapticlink.orchestrator.experiment import simulate
    from hapticlink.orchestrator.plan import Plan

    read = scene_file.load(scene, set or ())
    folder = out or default_folder("runs", scene)
    with progress(read.title, read.duration) as told:
        experiment = simulate(read, folder, set or (), told)
    outcome = experiment.outcome
    if outcome.fault:
        print(f"hapticlink: {outcome.fault}", file=sys.stderr)
    others = []
    if outcome.end_time > 0:
        from hapticlink.orchestrator.figures import draw

        plan = "\n".join(explained.explain(Plan(experiment.system)))
        (experiment.folder / "plan.txt").write_text(plan + "\n", encoding="utf-8")
        others = ["plan.txt", *draw(experiment.results)]
    speed = outcome.end_time / outcome.wall_time
    ends = {"stop_when": f"ended by {experiment.system.ends_when}", "duration": "done"}
    print(f"{read.title}: {ends.get(outcome.reason, outcome.reason)} at {outcome.end_time:g} s")
    print(f"  {outcome.wall_time:.2f} s of run time, {speed:.1f} times real time")
    tables = (f"{clock.name}.csv" for clock in experiment.system.timeline.clocks)
    print(f"  {folder}/: {', '.join([*tables, 'run.json', *others])}")
    return outcome.fault.exit_status if outcome.fault else 0


def _explain(scene: str, options: Sequence[str]) -> int:
    """Print the plan of a run, and run nothing."""
    import tempfile
    from pathlib import Path

    from hapticlink.orchestrator import explain, scene_file
    from hapticlink.orchestrator.blocks import fmu_files
    from hapticlink.orchestrator.plan import Plan
    from hapticlink.orchestrator.system import from_scene
    from hapticlink.orchestrator.timeline import timeline

    read = scene_file.load(scene, options)
    with tempfile.TemporaryDirectory(prefix="hapticlink-") as room:
        time = timeline(read)
        system = from_scene(read, time, fmu_files(read, time, Path(room)))
        for line in explain.explain(Plan(system)):
            print(line)
    return 0
