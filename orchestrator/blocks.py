"""From a scene to the FMUs of its blocks: which there are, of which settings, at which rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from hapticlink.components.specs import GraphicsCopy
from hapticlink.fmus.blocks import build_block
from hapticlink.fmus.errors import FmuError
from hapticlink.orchestrator import needs
from hapticlink.orchestrator.faults import InputFault
from hapticlink.orchestrator.scene import Scene
from hapticlink.orchestrator.ticks import Timeline


@dataclass(frozen=True)
class BlockPlan:
    """A block that the scene asks for: its settings and its rate, "haptics" or "graphics"."""

    name: str
    rate: str
    settings: dict[str, Any]
    kind: str = ""

    @property
    def made_by(self) -> str:
        """The name of the block in `fmus.blocks`."""
        return self.kind or self.name


def blocks(scene: Scene, *, skip: bool = True) -> tuple[BlockPlan, ...]:
    """The blocks of `scene`, in the order of the loop; skip=False with all that they can have."""
    if not skip:
        scene = needs.unskipped(scene)
    found = []
    if scene.hand:
        found.append(BlockPlan("hand", "haptics", {"hand": scene.hand}))
    for name, hand in scene.hands.items():
        found.append(BlockPlan(f"hand_{name}", "haptics", {"hand": hand}, "hand"))
    if scene.controller:
        parts = ("controller", "directions", "linkage")
        settings = {part: getattr(scene, part) for part in parts}
        found.append(BlockPlan("controller", "haptics", settings))
    if scene.device:
        found.append(BlockPlan("haptic_device", "haptics", {"device": scene.device}))
    if scene.linkage:
        settings = {"linkage": scene.linkage, "mechanism": scene.mechanism}
        if scene.directions_from == "mechanism" or scene.mechanism.directions:
            settings["directions"] = scene.directions
        if scene.contacts:
            settings |= {"contacts": scene.contacts, "length_scale": scene.directions.length_scale}
        found.append(BlockPlan("virtual_mechanism", scene.mechanism_at, settings))
    if scene.linkage and scene.graphics and (needs.graphics_block(scene) or not skip):
        names = (f.name for f in fields(GraphicsCopy))
        copy = GraphicsCopy(**{name: getattr(scene.graphics, name) for name in names})
        settings = {
            "linkage": scene.linkage,
            "graphics": copy,
            "directions": (
                scene.directions if needs.directions_from_graphics(scene) or not skip else None
            ),
            "contacts": scene.contacts if needs.contacts_from_graphics(scene) else None,
            "mobility": needs.mobility_from_graphics(scene) or not skip,
            "local_model": scene.local_model,
        }
        found.append(BlockPlan("virtual_environment", "graphics", settings))
    return tuple(found)


def settled(scene: Scene, block: BlockPlan, timeline: Timeline) -> dict[str, Any]:
    """The settings of a block, with what the timeline says."""
    if not scene.local_model or block.name != "virtual_mechanism":
        return block.settings
    frame = timeline.clock(timeline.of["virtual_environment"])
    return {**block.settings, "frame_s": timeline.seconds(frame.longest)}


def fmu_files(
    scene: Scene, timeline: Timeline, room: Path, platforms: Sequence[str] = ()
) -> dict[str, Path]:
    """Block name -> FMU file, from the cache, or made in `room` where the cache is off.

    platforms are those of native FMUs, this machine's where none is named. Raises InputFault where
    the settings give no FMU (a loop that does not close).
    """
    files = {}
    for block in blocks(scene):
        try:
            files[block.name] = build_block(
                block.made_by,
                settled(scene, block, timeline),
                room / block.name,  # two hands are two files of one name
                stop_time=scene.duration,
                step_size=timeline.seconds(timeline.clock(timeline.of[block.name]).longest),
                packaging=scene.packaging,
                platforms=platforms,
            )
        except FmuError as error:
            raise InputFault(str(error)) from error
    return files
