"""The exact timeline of a scene."""

from __future__ import annotations

import math
from fractions import Fraction

from hapticlink.orchestrator.blocks import blocks
from hapticlink.orchestrator.faults import SceneFault
from hapticlink.orchestrator.scene import Graphics, Scene, VariableRate
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
    """Clocks `haptics`, `graphics` where something runs at it, and those of FMUs at rates of their
    own; the end is the last haptic tick at or before the duration. Raises SceneFault where
    graphics.rate gives no frames."""
    haptic = 1 / exact(scene.haptics.rate)
    steps = math.floor(exact(scene.duration) / haptic)
    own = _own_rates(scene)
    periods, graphics = [haptic, *own.values()], None
    if any(b.clock == "graphics" for b in blocks(scene)) or "graphics" in _asked(scene):
        graphics = scene.graphics
    on_ticks = graphics is not None and (
        graphics.align == "tick" or isinstance(graphics.rate, VariableRate | tuple)
    )
    if graphics is not None and not on_ticks:
        periods.append(1 / exact(graphics.rate))  # type: ignore[arg-type]
    phase = None if graphics is None else graphics.phase
    first = None if phase is None else exact(phase)
    shortest = [exact(scene.step_control.min)] if scene.step_control else []
    starts = [first] if first and not on_ticks else []
    base = common_base([*periods, *shortest, *starts])
    a_tick = int(haptic / base)
    end = steps * a_tick
    found = [Clock("haptics", periodic(haptic, base, end))]
    if graphics and on_ticks:
        try:
            frames = _frames(graphics, haptic, steps)
        except ValueError as error:
            finding = scene.place(("graphics", "rate"), str(error))
            raise SceneFault(scene.title, [finding]) from error
        found.append(Clock("graphics", tuple(f * a_tick for f in frames)))
    elif graphics:
        found.append(Clock("graphics", periodic(periods[-1], base, end, first)))
    found += [Clock(name, periodic(period, base, end)) for name, period in own.items()]
    return Timeline(base, end, tuple(found))


def clock_of(rate: int | float | str, scene: Scene) -> str:
    """The clock of an [[fmu]]'s rate: "haptics", "graphics", or `100hz` for one of its own."""
    if rate in ("haptics", "graphics"):
        return str(rate)
    if exact(rate) == exact(scene.haptics.rate):
        return "haptics"
    return f"{str(rate).replace('/', '_')}hz"  # it names a file


def _asked(scene: Scene) -> dict[str, int | float | str]:
    """The rates of [[fmu]] tables by the name of their clock."""
    return {clock_of(f.rate, scene): f.rate for f in scene.fmu}


def _own_rates(scene: Scene) -> dict[str, Fraction]:
    """The periods (s) of the clocks that only [[fmu]] tables ask for, by name."""
    own = {n: r for n, r in _asked(scene).items() if n not in ("haptics", "graphics")}
    return {name: 1 / exact(rate) for name, rate in own.items()}


def _frames(graphics: Graphics, haptic: Fraction, steps: int) -> tuple[int, ...]:
    """Frames that end on haptic ticks, in those."""
    rate = graphics.rate
    if isinstance(rate, VariableRate):
        return variable(exact(rate.min), exact(rate.max), rate.seed, haptic, steps)
    if isinstance(rate, tuple):
        return listed([exact(time) for time in rate], haptic)
    first = None if graphics.phase is None else exact(graphics.phase)
    return aligned(1 / exact(rate), haptic, steps, first)
