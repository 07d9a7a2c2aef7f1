from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands import progress
from hapticlink.commands.options import PRINTED, UNCHANGED, Output, Scene, SceneOptions, title
from hapticlink.commands.sweep import Jobs
from hapticlink.orchestrator.base.process import count_processes

Seed = Annotated[int, Parameter(help="Seed of the draws.")]


def advise(
    scene: Scene,
    /,
    *,
    changes: SceneOptions = UNCHANGED,
    seed: Seed = 0,
    jobs: Jobs = None,
    output: Output = PRINTED,
) -> int:
    """Find the hold and the gains that suit a scene: all are run on it, and the best few on
    eight random variations of it; the gains of the best one are then scaled, too.

    Prints what to write into the scene, its error and energy, and which others were as good
    within the spread. Writes advice.json and table.csv to OUT (default advice/SCENE); the same
    command continues what was interrupted.

    For example:

        hapticlink advise closed-loop-direct --set graphics.rate=22
    """
    from hapticlink.analysis.advise.advise_method import advise as find
    from hapticlink.analysis.sweep.run_sweep import Means
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.results.write_files import write_json

    folder = folders.ensure(output.out or changes.folder("advice", scene))
    with progress.runs(f"{title(scene)}: methods on it and around it", output.quiet) as tell:
        means = Means(folder, count_processes(jobs), tell)
        advice = find(scene, changes.options, means, seed=seed)
    write_json(folder / "advice.json", advice.record())
    output.show(f"{title(scene)}:", (*advice.lines(), f"{folder}/"), advice.record())
    return 0
