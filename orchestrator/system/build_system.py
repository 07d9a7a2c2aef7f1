"""The system of a scene with its FMUs built: the start of a run, of `info` and of an export."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from hapticlink.fmus.blocks import Starts
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.assemble import from_scene
from hapticlink.orchestrator.system.fmu_files import fmu_files
from hapticlink.orchestrator.system.system import System
from hapticlink.orchestrator.system.timeline import timeline


@contextmanager
def built(scene: Scene, starts: Mapping[str, Starts] | None = None) -> Iterator[System]:
    """The system of `scene`, with its FMU files built or taken from the cache. `starts` is for FMUs
    that other tools run (`fmu_files`).

    Files that are not in the cache exist only within the context. Raises InputFault where no FMU
    can be built from the settings, SceneFault where FMUs and connections do not fit.
    """
    with temporary_folders.room_if_needed() as room:
        planned = blocks(scene)
        time = timeline(scene, planned)
        files = fmu_files(scene, planned, time, room, starts=starts)
        yield from_scene(scene, planned, time, files)
