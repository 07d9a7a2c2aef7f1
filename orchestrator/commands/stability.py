"""`hapticlink stability`."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.base.say import say
from hapticlink.orchestrator.commands.options import Out, Scene, Set, Swap, default_folder, options

At = Annotated[float, Parameter(help="Time (s) from which on no target, drive or wrench changes.")]


def stability(
    scene: Scene, /, *, out: Out = None, set: Set = None, swap: Swap = None, at: At = 0.0
) -> int:
    """Judge the stability of a scene around its equilibrium, from the linearised map of its
    co-simulation over a period of all its rates: spectral radius, modes and who takes part.

    Prints the result and writes stability.json to OUT (default runs/<scene>).
    """
    from hapticlink.orchestrator import api
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.results.files import write_json

    found = api.stability(scene, options(set, swap), at=at)
    folder = folders.ensure(out or default_folder("runs", scene))
    write_json(folder / "stability.json", found.record())
    say(f"{default_folder('runs', scene).name}: {found.verdict}")
    say(*(f"  {line}" for line in found.lines()), sep="\n")
    say(f"  {folder}/stability.json")
    return 0
