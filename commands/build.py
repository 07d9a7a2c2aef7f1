from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from hapticlink.commands.options import Out, Scene, Set, default_folder
from hapticlink.commands.progress import waiting
from hapticlink.orchestrator.base.terminal_output import say

AllPlatforms = Annotated[
    bool,
    Parameter(negative="", help="Compile for Linux, Windows and macOS, not this machine alone."),
]
AsOne = Annotated[
    bool,
    Parameter(negative="", help="One native FMU with all blocks, their rates and holds."),
]
Without = Annotated[
    str | None,
    Parameter(help="With --as-one: a block to leave out, whose outputs become inputs."),
]

Fmi = Annotated[
    int, Parameter(help="Of native FMUs and --as-one: the version of the standard, 2 or 3.")
]


def build(
    scene: Scene,
    /,
    *,
    out: Out = None,
    set: Set = None,
    all_platforms: AllPlatforms = False,
    as_one: AsOne = False,
    without: Without = None,
    fmi: Fmi = 2,
) -> int:
    """Build the FMUs of a scene in OUT (default fmus/SCENE), one file per block, or one for all.

    For example:

        hapticlink build closed-loop --set packaging=native --all-platforms
        hapticlink build closed-loop --set packaging=native --fmi 3
        hapticlink build closed-loop --as-one --without hand
        hapticlink build closed-loop --as-one --fmi 3
    """
    import hapticlink as hl

    folder = out or default_folder("fmus", scene)
    what = "one FMU of all its blocks" if as_one else "its FMUs"
    with waiting(f"{folder.name}: building {what}"):
        paths = hl.build(
            scene,
            set or (),
            out=folder,
            all_platforms=all_platforms,
            as_one=as_one,
            without=without,
            fmi=fmi,
        )
    say(*paths.values(), sep="\n")
    return 0
