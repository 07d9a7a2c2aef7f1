"""Start values of a scene's blocks, apart from the settings that their FMUs are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from hapticlink.components.blocks.start_settings import (
    has_free_start,
    start_pose,
    without_start_values,
)
from hapticlink.components.specs.linkage import Linkage, Start
from hapticlink.orchestrator.base import plugins, shelf
from hapticlink.orchestrator.scene.blocks import BlockPlan, Blocks

if TYPE_CHECKING:
    from hapticlink.components.dynamics.start_poses import Choice, StartPoses

Starts = Mapping[str, Start]


def separate_start_values(planned: Blocks) -> Blocks:
    """The blocks of a run: in place of their start values their own have those of which an FMU is
    made, and `starts`."""
    linkage = next((b.settings["linkage"] for b in planned.own if has_free_start(b.settings)), None)
    made = linkage and replace(linkage, start=_find_made(linkage))
    own = tuple(_separate(block, made) for block in planned.own)
    return replace(planned, own=own, built=(*own, *planned.built[len(own) :]))


def _separate(block: BlockPlan, made: Linkage | None) -> BlockPlan:
    settings, starts = without_start_values(block.block, block.settings)
    if made and has_free_start(settings):
        starts |= start_pose(settings["linkage"])
        settings["linkage"] = made
    return replace(block, settings=settings, starts=starts)


@dataclass
class _KnownPoses:
    """The start poses that this process has had of a linkage: the first one, and of each choice of
    coordinates one for which FMUs are made. linkage: without its start."""

    linkage: Linkage
    first: Starts
    made: dict[Choice, Starts] = field(default_factory=dict)
    poses: StartPoses | None = None

    def find(self, start: Starts) -> Starts:
        """The pose whose FMUs have the equations of `start`; that itself where none has."""
        if repr(start) == repr(self.first):
            return self.first
        if self.poses is None:
            from hapticlink.components.dynamics.start_poses import StartPoses  # loads CasADi
            from hapticlink.fmus.fmu_functions import GRAPHS

            with GRAPHS:
                self.poses = StartPoses(self.linkage)
            self._add(self.poses, self.first)
        return self._add(self.poses, start)

    def _add(self, poses: StartPoses, start: Starts) -> Starts:
        choice = poses.choose(start)
        return start if choice is None else self.made.setdefault(choice, start)


_KNOWN: shelf.Shelf[_KnownPoses] = shelf.Shelf(4)


def _find_made(linkage: Linkage) -> Starts:
    """The start pose for which FMUs are made: that of a linkage before, of whose equations this
    process knows that they are the same."""
    if not shelf.is_keeping() or plugins.list_plugins():
        return linkage.start
    own = replace(linkage, start={})
    known = _KNOWN.take(lambda item: item.linkage == own) or _KnownPoses(own, linkage.start)
    try:
        return known.find(linkage.start)
    except ValueError:  # which making the FMUs tells
        return linkage.start
    finally:
        _KNOWN.put(known)
