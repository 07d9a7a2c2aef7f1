"""`hapticlink export`."""

from __future__ import annotations

from pathlib import Path

from hapticlink.orchestrator.commands.options import Out, Scene, Set


def export(scene: Scene, /, *, out: Out = None, set: Set = None) -> int:
    """Write a scene as OUT/<scene>.ssp (default ssp/): its FMUs and connections for other tools;
    `hapticlink run` reads it back, rates and holds included."""
    from hapticlink.orchestrator import open_scene
    from hapticlink.orchestrator.base import temporary_folders
    from hapticlink.orchestrator.ssp import write
    from hapticlink.orchestrator.system import assemble, fmu_files, timeline

    read = open_scene.load(scene, set or ())
    time = timeline.timeline(read)
    target = (out or Path("ssp")) / f"{Path(scene).stem}.ssp"
    with temporary_folders.room() as room:
        made = assemble.from_scene(read, time, fmu_files.fmu_files(read, time, room))
        print(write.write(read, made, target))
    return 0
