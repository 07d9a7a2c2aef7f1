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
    if not isinstance(read.graphics.rate, int | float | str):
        raise InputFault(
            "graphics.rate varies, so that there is no map of a period: take a fixed rate, such as "
            "--set graphics.rate=30"
        )
    haptic = exact(read.haptics.rate)
    count = max(1, round(haptic / exact(read.graphics.rate)))
    return (*given, f'graphics.rate="{haptic / count}"')
