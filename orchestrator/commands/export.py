"""`hapticlink export`."""

from __future__ import annotations

from pathlib import Path

from hapticlink.orchestrator.commands.options import Out, Scene, Set


def export(scene: Scene, /, *, out: Out = None, set: Set = None) -> int:
    """Write a scene as OUT/<scene>.ssp (default ssp/): its FMUs and connections for other tools;
    `hapticlink run` reads it back, rates and holds included."""
    from hapticlink.orchestrator import blocks, rooms, scene_file, ssp_write, system, timeline

    read = scene_file.load(scene, set or ())
    time = timeline.timeline(read)
    target = (out or Path("ssp")) / f"{Path(scene).stem}.ssp"
    with rooms.room() as room:
        made = system.from_scene(read, time, blocks.fmu_files(read, time, room))
        print(ssp_write.write(read, made, target))
    return 0
