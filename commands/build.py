"""`hapticlink build`."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands.options import Out, Scene, Set, default_folder
from hapticlink.orchestrator.base.terminal_output import say

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
    import hapticlink as hl

    folder = out or default_folder("fmus", scene)
    made = hl.build(scene, set or (), out=folder, all_platforms=all_platforms)
    say(*made.values(), sep="\n")
    return 0
