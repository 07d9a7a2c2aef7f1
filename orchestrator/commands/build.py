"""`hapticlink build`."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.base.say import say
from hapticlink.orchestrator.commands.options import Out, Scene, Set, default_folder

AllPlatforms = Annotated[
    bool,
    Parameter(negative="", help="Compile for Linux, Windows and macOS, not this machine alone."),
]


def build(
    scene: Scene, /, *, out: Out = None, set: Set = None, all_platforms: AllPlatforms = False
) -> int:
    """Build the FMUs of a scene in OUT (default fmus/SCENE), one file per block.

    For example:

        hapticlink build closed-loop --set packaging=native --all-platforms
    """
    from hapticlink.orchestrator import api

    folder = out or default_folder("fmus", scene)
    made = api.build(scene, set or (), out=folder, all_platforms=all_platforms)
    say(*made.values(), sep="\n")
    return 0
