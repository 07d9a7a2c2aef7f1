"""Rates with a short hyperperiod."""

from __future__ import annotations

from collections.abc import Sequence

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene.scene import Scene


def whole_frames(read: Scene, given: Sequence[str]) -> tuple[str, ...]:
    """The options with the graphics rate next to that of a scene whose frames are whole haptic
    periods. Raises InputFault for one that varies."""
    if read.graphics is None:
        return tuple(given)
    return (*given, f'graphics.rate="{exact(read.haptics.rate) / frame_length(read)}"')


def frame_length(read: Scene) -> int:
    """Whole haptic periods next to a frame of the scene, which has a graphics rate. Raises
    InputFault for one that varies."""
    assert read.graphics is not None
    if not isinstance(read.graphics.rate, int | float | str):
        raise InputFault(
            "graphics.rate varies, so that there is no map of a period: take a fixed rate, such as "
            "--set graphics.rate=30"
        )
    return max(1, round(exact(read.haptics.rate) / exact(read.graphics.rate)))
