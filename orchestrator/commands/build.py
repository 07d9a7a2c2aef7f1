"""`hapticlink build`."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from hapticlink.orchestrator.commands.options import Out, Scene, Set, default_folder


def build(scene: Scene, /, *, out: Out = None, set: Set = None) -> int:
    """Build the FMUs of a scene into OUT (default fmus/<scene>), one file a block."""
    from hapticlink.orchestrator import blocks, scene_file, timeline

    read = scene_file.load(scene, set or ())
    folder = out or default_folder("fmus", scene)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="hapticlink-") as room:
        for path in blocks.fmu_files(read, timeline.timeline(read), Path(room)).values():
            print(shutil.copy(path, folder))
    return 0
