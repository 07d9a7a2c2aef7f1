"""`hapticlink advise`."""

from __future__ import annotations

import os
from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands import progress
from hapticlink.commands.options import (
    UNCHANGED,
    Changes,
    Json,
    Out,
    Quiet,
    Scene,
    default_folder,
    print_result,
)
from hapticlink.commands.sweep import Jobs

Draws = Annotated[int, Parameter(help="Hands and rates around the scene's own.")]
Seed = Annotated[int, Parameter(help="Seed of the draws.")]


def advise(
    scene: Scene,
    /,
    *,
    out: Out = None,
    changes: Changes = UNCHANGED,
    draws: Draws = 8,
    seed: Seed = 0,
    jobs: Jobs = None,
    quiet: Quiet = False,
    json: Json = False,
) -> int:
    """Find the hold and the gains that suit a scene: all are run on it, and the best few in draws
    around it.

    Prints what to write into the scene, what it costs in error and energy, and what was within the
    spread. Writes advice.json and table.csv to OUT (default advice/SCENE); the same command
    continues what was interrupted.

    For example:

        hapticlink advise closed-loop-direct --set graphics.rate=22
    """
    from hapticlink.analysis.advise.advise_method import advise as find
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.results.files import write_json

    folder = folders.ensure(out or changes.folder("advice", scene))
    name, processes = default_folder("advice", scene).name, jobs or os.cpu_count() or 1
    with progress.runs(f"{name}: methods on it and around it", quiet) as show:
        advice = find(
            scene,
            changes.options,
            folder,
            processes=processes,
            count=draws,
            seed=seed,
            tell=show,
        )
    write_json(folder / "advice.json", advice.record())
    lines = (f"{name}:", *(f"  {line}" for line in advice.lines()), f"  {folder}/")
    print_result(lines, advice.record(), quiet, json)
    return 0
