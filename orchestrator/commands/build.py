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
    from hapticlink.orchestrator import open_scene
    from hapticlink.orchestrator.base import temporary_folders
    from hapticlink.orchestrator.base.faults import InputFault
    from hapticlink.orchestrator.results import folders
    from hapticlink.orchestrator.scene import blocks
    from hapticlink.orchestrator.system import fmu_files, timeline

    read = open_scene.load(scene, set or ())
    if all_platforms and read.packaging != "native":
        raise InputFault("--all-platforms compiles: add --set packaging=native")
    platforms = PLATFORMS if all_platforms else ()
    if not blocks.blocks(read):
        raise InputFault(f"{scene}: nothing to build: its FMUs are given as files")
    folder = folders.made(out or default_folder("fmus", scene))
    with temporary_folders.room() as room:
        time = timeline.timeline(read)
        for name, path in fmu_files.fmu_files(read, time, room, platforms).items():
            print(shutil.copy(path, folder / f"{name}.fmu"))
    return 0
