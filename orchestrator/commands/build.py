"""`hapticlink build`."""

from __future__ import annotations

import shutil
from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.commands.options import Out, Scene, Set, default_folder

AllPlatforms = Annotated[
    bool,
    Parameter(negative="", help="Compile for Linux, Windows and macOS, not this machine alone."),
]


def build(
    scene: Scene, /, *, out: Out = None, set: Set = None, all_platforms: AllPlatforms = False
) -> int:
    """Build the FMUs of a scene into OUT (default fmus/<scene>), one file a block."""
    from hapticlink.fmus.native import PLATFORMS
    from hapticlink.orchestrator import blocks, folders, rooms, scene_file, timeline
    from hapticlink.orchestrator.faults import InputFault

    read = scene_file.load(scene, set or ())
    if all_platforms and read.packaging != "native":
        raise InputFault("--all-platforms compiles: add --set packaging=native")
    platforms = PLATFORMS if all_platforms else ()
    if not blocks.blocks(read):
        raise InputFault(f"{scene}: nothing to build: its FMUs are given as files")
    folder = folders.made(out or default_folder("fmus", scene))
    with rooms.room() as room:
        time = timeline.timeline(read)
        for name, path in blocks.fmu_files(read, time, room, platforms).items():
            print(shutil.copy(path, folder / f"{name}.fmu"))
    return 0
