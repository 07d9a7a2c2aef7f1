"""Start values of a scene's blocks, apart from the settings that their FMUs are made of."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from hapticlink.components.blocks.start_settings import (
    has_free_start,
    start_pose,
    without_start_values,
)
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base import plugins, shelf
from hapticlink.orchestrator.scene.blocks import BlockPlan, Blocks

if TYPE_CHECKING:
    from hapticlink.components.dynamics.start_poses import Choice, StartPoses


def separate_start_values(planned: Blocks) -> Blocks:
    """The blocks of a run: in place of their start values their own have those of which an FMU is
    made, and `starts`."""
    linkage = next((b.settings["linkage"] for b in planned.own if has_free_start(b.settings)), None)
    common = linkage and _made_for(linkage)
    own = tuple(_separate(block, common) for block in planned.own)
    return replace(planned, own=own, built=(*own, *planned.built[len(own) :]))


def _separate(block: BlockPlan, common: Linkage | None) -> BlockPlan:
    settings, starts = without_start_values(block.block, block.settings)
    if common and has_free_start(settings):
        starts |= start_pose(settings["linkage"])
        settings["linkage"] = common
    return replace(block, settings=settings, starts=starts)


@dataclass
class _KnownPoses:
    """The linkages that this process has had which differ in their start pose alone: the first one,
    and of each choice of coordinates one of which FMUs are made. text: without `start`."""

    text: str
    first: Linkage
    made: dict[Choice, Linkage] = field(default_factory=dict)
    poses: StartPoses | None = None

    def find(self, linkage: Linkage) -> Linkage:
        """The one whose FMUs have the equations of `linkage`; that itself where none has."""
        if repr(linkage.start) == repr(self.first.start):
            return self.first
        if self.poses is None:
            from hapticlink.components.dynamics.start_poses import StartPoses  # loads CasADi
            from hapticlink.fmus.fmu_functions import GRAPHS

            with GRAPHS:
                self.poses = StartPoses(self.first)
            self._add(self.first)
        return self._add(linkage)

    def _add(self, linkage: Linkage) -> Linkage:
        assert self.poses
        choice = self.poses.choose(linkage.start)
        return linkage if choice is None else self.made.setdefault(choice, linkage)


_KNOWN: shelf.Shelf[_KnownPoses] = shelf.Shelf(4)


def _made_for(linkage: Linkage) -> Linkage:
    """The linkage with the start pose for which FMUs are made: that of one before, of whose
    equations this process knows that they are the same."""
    if not shelf.is_keeping() or plugins.list_plugins():
        return linkage
    text = repr(replace(linkage, start={}))
    known = _KNOWN.take(lambda item: item.text == text) or _KnownPoses(text, linkage)
    try:
        return known.find(linkage)
    except ValueError:  # which making the FMUs tells
        return linkage
    finally:
        _KNOWN.put(known)
