"""Ages of samples when they are used, and causality, derived from a plan."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice

from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.plan.operations import Event
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.stamps import Stamps
from hapticlink.orchestrator.system.system import System


@dataclass(frozen=True)
class Delay:
    """Age (s) of the newest sample that an input is computed from, at the time when it is set."""

    min: float
    max: float
    mean: float


def causal(ages: Mapping[str, Delay]) -> bool:
    """Whether no FMU reads a sample that is stamped later than the start of its step."""
    return all(age.min >= 0 for age in ages.values())


class Ages:
    """Collects the ages of samples event by event, until the pattern of events repeats.

    An input is held until it is set again, which adds to the age. The first event is left out,
    since all its samples are of t = 0.
    """

    def __init__(self, plan: Plan) -> None:
        self._seconds = plan.system.timeline.seconds
        self._last = pattern_end(plan.system)
        self._found: dict[str, list[int]] = {}  # min, max, sum, number
        self._stamps = Stamps(plan, self._count)

    def event(self, tick: int, event: Event) -> bool:
        """Process an event, in the order of time; returns whether further events are needed."""
        if tick <= self._last:
            self._stamps.event(tick, event)
        return tick < self._last

    def _count(self, tick: int, connection: str, stamp: int) -> None:
        if not tick:
            return
        age = tick - stamp
        if (counted := self._found.get(connection)) is None:
            self._found[connection] = [age, age, age, 1]
            return
        if age < counted[0]:
            counted[0] = age
        elif age > counted[1]:
            counted[1] = age
        counted[2] += age
        counted[3] += 1

    def delays(self) -> dict[str, Delay]:
        seconds = self._seconds
        return {
            name: Delay(seconds(least), seconds(most), seconds(total) / number)
            for name, (least, most, total, number) in self._found.items()
        }


MAX_EVENTS = 100_000
"""Number of events that are processed without a run if their pattern does not repeat."""


def delays(plan: Plan, events: int = MAX_EVENTS) -> dict[str, Delay]:
    ages = Ages(plan)
    for tick, event in islice(plan, events):
        if not ages.event(tick, event):
            break
    return ages.delays()


def pattern_end(system: System) -> int:
    """The last tick of the first hyperperiod that begins after all phases and constant latencies;
    the end of the run if the pattern of events does not repeat."""
    timeline = system.timeline
    clocks, late = timeline.clocks, [c.latency for c in system.connections if c.latency]
    drawn = any(way.loss or way.max not in (None, way.min) for way in late)
    periods = [c.period for c in clocks if c.period]
    if drawn or len(periods) < len(clocks):
        return timeline.end
    begun = max(c.first % c.longest for c in clocks)
    begun += max((math.ceil(exact(way.min) / timeline.base) for way in late), default=0)
    return min(timeline.end, begun + math.lcm(*periods))
