"""The system of a scene with its FMUs built: what runs, prints and exports a scene starts from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType

from hapticlink.fmus.blocks import Starts
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.assemble import from_scene
from hapticlink.orchestrator.system.fmu_files import fmu_files
from hapticlink.orchestrator.system.system import System
from hapticlink.orchestrator.system.timeline import timeline


@contextmanager
def built(scene: Scene, starts: Mapping[str, Starts] = MappingProxyType({})) -> Iterator[System]:
    """The system of `scene`. Its FMU files are there within; those in the cache, later too.
    `starts` by block go before the start values of its parameters.

    Raises InputFault where the settings give no FMU, SceneFault for what does not fit together.
    """
    with temporary_folders.room() as room:
        time = timeline(scene)
        yield from_scene(scene, time, fmu_files(scene, time, room, starts=starts))
