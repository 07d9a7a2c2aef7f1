"""`hapticlink tune`."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.base.say import say
from hapticlink.orchestrator.commands.options import Out, Scene, Set, default_folder, options

Margin = Annotated[
    float, Parameter(help="Factor on all stiffnesses, 1 or more, at which the map is unstable.")
]
Hertz = Annotated[float, Parameter(help="Frequency (Hz) of pressing at which stiffness is felt.")]
Neighbours = Annotated[bool, Parameter(help="Margins at neighbouring rates, as well.")]


def tune(
    scene: Scene,
    /,
    *,
    out: Out = None,
    set: Set = None,
    margin: Margin = 2.0,
    hertz: Hertz = 2.0,
    neighbours: Neighbours = True,
) -> int:
    """Find gains up to a margin of stability for the scene's rates and holds, at its start pose and
    at a contact, if there is one; both shall feel equally stiff.

    Prints gains, felt stiffnesses and margins. Writes tune.json, tune.png and tuned.toml, a scene
    that extends SCENE with the gains, to OUT (default tuned/SCENE). What has been confirmed by
    runs, and what has not: results/tune/README.md.

    For example:

        hapticlink tune closed-loop --set sensing=encoders --set graphics.rate=32
    """
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.results.figure_axes import png, write
    from hapticlink.orchestrator.results.files import write_json
    from hapticlink.orchestrator.tune import figure
    from hapticlink.orchestrator.tune import tune as find
    from hapticlink.orchestrator.tune.scene_file import tuned_scene

    given = options(set, None)
    found = find(scene, given, margin=margin, hertz=hertz, neighbours=neighbours, tell=say)
    folder = folders.ensure(out or default_folder("tuned", scene))
    write_json(folder / "tune.json", found.record())
    (folder / "tuned.toml").write_text(tuned_scene(scene, found), encoding="utf-8")
    write([("tune", png(figure.draw(found)))], folder)
    say(*(f"  {line}" for line in found.lines()), sep="\n")
    say(f"  {folder}/: tune.json, tune.png, tuned.toml")
    return 0
