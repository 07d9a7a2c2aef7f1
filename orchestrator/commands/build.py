"""`hapticlink build`."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
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
    from hapticlink.orchestrator import blocks, scene_file, timeline
    from hapticlink.orchestrator.faults import InputFault

    read = scene_file.load(scene, set or ())
    if all_platforms and read.packaging != "native":
        raise InputFault("--all-platforms compiles: add --set packaging=native")
    platforms = PLATFORMS if all_platforms else ()
    folder = out or default_folder("fmus", scene)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="hapticlink-") as room:
        time = timeline.timeline(read)
        for name, path in blocks.fmu_files(read, time, Path(room), platforms).items():
            print(shutil.copy(path, folder / f"{name}.fmu"))
    return 0
