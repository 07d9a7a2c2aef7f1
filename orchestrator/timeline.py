"""The exact timeline of a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from hapticlink.orchestrator.clocks import Pace, clocks
from hapticlink.orchestrator.faults import SceneFault
from hapticlink.orchestrator.rates import VariableRate
from hapticlink.orchestrator.scene import Scene
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
    """The clocks that FMUs run at, and `haptics`; the end is the last haptic tick at or before the
    duration. Raises SceneFault where a rate gives no steps."""
    haptic = 1 / exact(scene.haptics.rate)
    steps = math.floor(exact(scene.duration) / haptic)
    given = clocks(scene)
    exactly = [p for p in given.paces.values() if not p.on_ticks]
    spans = [span for p in exactly for span in (_period(p), p.first or _period(p))]
    base = common_base([*spans, *([exact(scene.step_control.min)] if scene.step_control else [])])
    a_tick = int(haptic / base)
    found = []
    for name, pace in given.paces.items():
        if not pace.on_ticks:
            starts = periodic(_period(pace), base, steps * a_tick, pace.first)
        else:
            try:
                starts = tuple(start * a_tick for start in _on_ticks(pace, haptic, steps))
            except ValueError as error:
                raise SceneFault(scene.title, [scene.place(pace.path, str(error))]) from error
        found.append(Clock(name, starts))
    return Timeline(base, steps * a_tick, tuple(found), given.of)


def _period(pace: Pace) -> Fraction:
    assert isinstance(pace.rate, Fraction)
    return 1 / pace.rate


def _on_ticks(pace: Pace, haptic: Fraction, steps: int) -> Sequence[int]:
    """Starts of steps on haptic ticks, in those."""
    if isinstance(pace.rate, VariableRate):
        low, high, seed = exact(pace.rate.min), exact(pace.rate.max), pace.rate.seed
        return variable(low, high, seed, haptic, steps)
    if isinstance(pace.rate, tuple):
        starts = listed([exact(time) for time in pace.rate], haptic)
        # A last time that is the end of the run has a row, too.
        return (*starts, 2 * starts[-1] - starts[-2])
    return aligned(_period(pace), haptic, steps, pace.first)
