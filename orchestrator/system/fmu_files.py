"""The FMU files of a scene's blocks, from the cache or built."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hapticlink.fmus.blocks import Starts, build_block
from hapticlink.fmus.errors import CompilerError, FmuError
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.base.faults import Fault, InputFault
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.scene.blocks import BlockPlan, blocks
from hapticlink.orchestrator.scene.scene import Scene


def settled(scene: Scene, block: BlockPlan, timeline: Timeline) -> dict[str, Any]:
    """The settings of a block. A mechanism with a local model also gets the longest step of the
    graphics copy, `frame_s` (s)."""
    if not scene.local_model or block.name != "virtual_mechanism":
        return block.settings
    frame = timeline.clock(timeline.of["virtual_environment"])
    return {**block.settings, "frame_s": timeline.seconds(frame.longest)}


def fmu_files(
    scene: Scene,
    timeline: Timeline,
    room: Path,
    platforms: Sequence[str] = (),
    starts: Mapping[str, Starts] = MappingProxyType({}),
) -> dict[str, Path]:
    """The FMU file of each block by its name, from the cache, or built in `room` where the cache is
    off.

    platforms: those of native FMUs, by default this machine's. starts: by block, values that
    override the start values of its parameters. Raises InputFault where no FMU can be built from
    the settings (a loop that does not close), Fault where the compiler fails.
    """
    files = {}
    for block in blocks(scene):
        interrupt.check()
        try:
            files[block.name] = build_block(
                block.made_by,
                settled(scene, block, timeline),
                room / block.name,  # two hands are two files of one name
                stop_time=scene.duration,
                step_size=timeline.seconds(timeline.clock(timeline.of[block.name]).longest),
                packaging=scene.packaging,
                platforms=platforms,
                starts=starts.get(block.name, {}),
            )
        except CompilerError as error:
            interrupt.check()  # Ctrl-C in a terminal ends the compiler too
            raise Fault(str(error)) from error
        except FmuError as error:
            raise InputFault(str(error)) from error
    return files
