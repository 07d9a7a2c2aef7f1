from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands.options import Out, Scene, Set, default_folder
from hapticlink.orchestrator.base.terminal_output import say

Margin = Annotated[
    float, Parameter(help="Factor (1 or more) on all stiffnesses up to which it is stable.")
]


def tune(
    scene: Scene,
    /,
    *,
    out: Out = None,
    set: Set = None,
    margin: Margin = 2.0,
) -> int:
    """Find gains with which contact and joint constraint feel equally stiff, as stiff as a margin
    of stability allows for the scene's rates and holds, in poses of its own run.

    Prints gains, felt stiffnesses and margins. Writes tuned.toml, the scene with the gains,
    tune.json and tune.png to OUT (default tuned/SCENE), at once whenever it has found better ones,
    so that Ctrl-C leaves the best so far. What has been confirmed by runs, and what has not:
    results/tune/README.md.

    For example:

        hapticlink tune closed-loop --set sensing=encoders
    """
    from hapticlink.analysis.tune.tune_gains import Tuned
    from hapticlink.analysis.tune.tune_gains import tune as find
    from hapticlink.orchestrator.base.errors import Interrupted
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.results.write_files import write_json
    from hapticlink.visualization import figure_files
    from hapticlink.visualization.figures import tuning_figure

    folder = out or default_folder("tuned", scene)

    kept = False

    def keep(tuned: Tuned) -> None:
        nonlocal kept
        folders.ensure(folder)
        write_json(folder / "tune.json", tuned.record())
        (folder / "tuned.toml").write_text(tuned.scene(), encoding="utf-8")
        figure_files.save({"tune": tuning_figure.draw(tuned)}, folder)
        kept = True

    try:
        result = find(scene, set or (), margin=margin, tell=say, keep=keep)
    except Interrupted:
        say(f"interrupted: {f'{folder}/ has' if kept else 'no'} gains found so far")
        return 1
    say(*(f"  {line}" for line in result.lines()), sep="\n")
    say(f"  {folder}/: tuned.toml, tune.json, tune.png")
    return 0
