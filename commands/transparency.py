from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands.options import PRINTED, UNCHANGED, Output, Scene, SceneOptions, title
from hapticlink.commands.progress import waiting
from hapticlink.orchestrator.base.terminal_output import say

Poses = Annotated[int, Parameter(help="Number of poses of the scene's run.")]
Costs = Annotated[
    bool, Parameter(negative="", help="Tell also what rates, delays and holds cost at the start.")
]


def transparency(
    scene: Scene,
    /,
    *,
    changes: SceneOptions = UNCHANGED,
    poses: Poses = 2,
    costs: Costs = False,
    output: Output = PRINTED,
) -> int:
    """Compare what the hand meets at the handle with the mechanism that it should meet.

    At poses of the scene's run, by direction up to 50 Hz: felt inertia, felt stiffness of
    constrained directions, and the frequency up to which force and direction are within what a
    person can tell (docs/transparency.md). Writes transparency.json and transparency.png to OUT
    (default `runs/SCENE`).

    For example:

        hapticlink transparency closed-loop --set sensing=encoders --costs
    """
    from hapticlink.analysis.transparency import mobility_at_hand as analysis
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.results.write_files import write_json
    from hapticlink.visualization import figure_files
    from hapticlink.visualization.figures import transparency_figure

    given, what = changes.options, "equilibria and linearisations, which can take a minute"
    with waiting(f"{title(scene)}: {what}", output.quiet):
        in_poses = analysis.transparency(scene, given, count=poses)
        beside = analysis.costs(scene, given, say) if costs else []
    folder = folders.ensure(output.out or changes.folder("runs", scene))
    record = {
        "title": in_poses[0].title,
        "poses": [pose.record() for pose in in_poses],
        "changes": {cost.change: cost.record() for cost in beside},
    }
    write_json(folder / "transparency.json", record)
    figure_files.save({"transparency": transparency_figure.draw(in_poses)}, folder)
    lines = [line for pose in in_poses for line in pose.lines()]
    lines += analysis.cost_lines(beside) if beside else []
    output.show(f"{title(scene)}:", (*lines, f"{folder}/"), record)
    return 0
