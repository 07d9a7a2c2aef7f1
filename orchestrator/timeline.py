"""The exact timeline of a scene."""

from __future__ import annotations

import math
from fractions import Fraction

from hapticlink.orchestrator.blocks import blocks
from hapticlink.orchestrator.faults import Finding, SceneFault
from hapticlink.orchestrator.scene import Scene, VariableRate
from hapticlink.orchestrator.ticks import (
    Clock,
    Timeline,
    aligned,
    common_base,
    exact,
    listed,
    periodic,
    variable,
)


def timeline(scene: Scene) -> Timeline:
    """Clocks `haptics` and, where a block runs at it, `graphics`; the end is the last haptic tick
    at or before the duration. Raises SceneFault where graphics.rate gives no frames."""
    haptic = 1 / exact(scene.haptics.rate)
    steps = math.floor(exact(scene.duration) / haptic)
    if scene.graphics is None or all(b.clock != "graphics" for b in blocks(scene)):
        return Timeline(haptic, steps, (Clock("haptics", periodic(haptic, haptic, steps)),))
    rate, fixed = scene.graphics.rate, None
    base = haptic
    if not isinstance(rate, VariableRate | tuple):
        fixed = 1 / exact(rate)
        if scene.graphics.align != "tick":
            base = common_base([haptic, fixed])
    end = steps * int(haptic / base)
    try:
        frames = _frames(rate, fixed, base, end, scene.graphics.align)
    except ValueError as error:
        raise SceneFault(scene.title, [Finding("graphics.rate", str(error))]) from error
    haptics = Clock("haptics", periodic(haptic, base, end))
    return Timeline(base, end, (haptics, Clock("graphics", frames)))


def _frames(
    rate: object, fixed: Fraction | None, base: Fraction, end: int, align: str | None
) -> range | tuple[int, ...]:
    if fixed is not None:
        return aligned(fixed, base, end) if align == "tick" else periodic(fixed, base, end)
    if isinstance(rate, VariableRate):
        return variable(exact(rate.min), exact(rate.max), rate.seed, base, end)
    assert isinstance(rate, tuple)
    return listed([exact(time) for time in rate], base)
