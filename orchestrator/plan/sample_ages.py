"""Causality of a plan without running an FMU: the stamp of the sample behind each input."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.plan.operations import (
    Blend,
    Evaluate,
    Event,
    Get,
    Operation,
    Push,
    Set,
)
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.system.latency import Link
from hapticlink.orchestrator.system.system import System


class Use(NamedTuple):
    """At `tick` the target of `connection` was given a value made from samples up to `stamp`."""

    tick: int
    connection: str
    stamp: int


Take = Callable[[int, str, int], object]
"""What is told each Use."""


class Stamps:
    """The stamps of all samples while a plan is gone through; `take` is told of each that is used.
    Events of one kind do the same, so what they do is bound once."""

    def __init__(self, plan: Plan, take: Take) -> None:
        system = plan.system
        self._plan, self._take = plan, take
        self._connections = {c.name: c for c in system.connections}
        self._incoming = {u.name: system.into(u.name) for u in system.fmus}
        self._got = dict.fromkeys(system.fmu, 0)
        self._pushed = dict.fromkeys(self._connections, 0)
        self._held = dict.fromkeys(self._connections, 0)
        base = system.timeline.base
        held = (c for c in system.connections if c.hold and c.latency)
        self._links = {c.name: Link(c.latency, base) for c in held if c.latency}
        self._bound: dict[Event, list[Callable[[int], None]]] = {}

    def event(self, tick: int, event: Event) -> None:
        """Go through an event; they come in time."""
        if (bound := self._bound.get(event)) is None:
            operations = self._plan.unrolled(event)
            bound = [each for op in operations if (each := self._bind(op))]
            self._bound[event] = bound
        for each in bound:
            each(tick)

    def _bind(self, operation: Operation) -> Callable[[int], None] | None:
        got, pushed, held, links = self._got, self._pushed, self._held, self._links
        match operation:
            case Get(fmu, ahead):

                def get(tick: int) -> None:
                    got[fmu] = tick + ahead

                return get
            case Push(name, ahead):
                source, link = self._connections[name].source, links.get(name)

                def push(tick: int) -> None:
                    stamp = tick + ahead if ahead else got[source]
                    if link:
                        link.send(stamp)
                    else:
                        pushed[name] = stamp

                return push
            case Evaluate(name) | Blend(name):
                arriving = links.get(name)

                def evaluate(tick: int) -> None:
                    for _, stamp, _ in arriving.arrived(tick) if arriving else ():
                        pushed[name] = stamp
                    held[name] = pushed[name]

                return evaluate
            case Set(fmu, now):
                return self._set(fmu, now)
        return None

    def _set(self, fmu: str, now: bool) -> Callable[[int], None]:
        take, got, held = self._take, self._got, self._held
        inputs = [
            (c.name, held, c.name) if c.hold and not now else (c.name, got, c.source)
            for c in self._incoming[fmu]
        ]

        def used(tick: int) -> None:
            for name, stamps, source in inputs:
                take(tick, name, stamps[source])

        return used


def uses(plan: Plan, until: int | None = None) -> Iterator[Use]:
    """Every value given to every input over the whole run, or up to a tick, in order."""
    found: list[Use] = []
    stamps = Stamps(plan, lambda *use: found.append(Use(*use)))
    for tick, event in plan:
        if until is not None and tick > until:
            return
        stamps.event(tick, event)
        yield from found
        found.clear()


@dataclass(frozen=True)
class Delay:
    """How old (s) the newest sample is that an input is made from when it is set."""

    least: float
    most: float
    mean: float


def causal(ages: Mapping[str, Delay]) -> bool:
    """Whether nobody reads a value stamped later than the start of its step."""
    return all(age.least >= 0 for age in ages.values())


class Ages:
    """How old samples are when they are used, counted while a run goes on, until it comes round.
    The hold of an input until its next set comes on top. The first event is left out: there
    everything is of t = 0."""

    def __init__(self, plan: Plan) -> None:
        self._seconds = plan.system.timeline.seconds
        self._last = comes_round(plan.system)
        self._found: dict[str, list[int]] = {}  # least, most, sum, number
        self._stamps = Stamps(plan, self._count)

    def event(self, tick: int, event: Event) -> bool:
        """Go through an event; they come in time. Whether there is more to count."""
        if tick <= self._last:
            self._stamps.event(tick, event)
        return tick < self._last

    def _count(self, tick: int, connection: str, stamp: int) -> None:
        if not tick:
            return
        age = tick - stamp
        if (found := self._found.get(connection)) is None:
            self._found[connection] = [age, age, age, 1]
            return
        if age < found[0]:
            found[0] = age
        elif age > found[1]:
            found[1] = age
        found[2] += age
        found[3] += 1

    def delays(self) -> dict[str, Delay]:
        """By connection."""
        seconds = self._seconds
        return {
            name: Delay(seconds(least), seconds(most), seconds(total) / number)
            for name, (least, most, total, number) in self._found.items()
        }


MOST = 100_000
"""Events that are gone through before a run, where it does not come round."""


def delays(plan: Plan) -> dict[str, Delay]:
    """By connection, without a run."""
    ages = Ages(plan)
    for tick, event in islice(plan, MOST):
        if not ages.event(tick, event):
            break
    return ages.delays()


def comes_round(system: System) -> int:
    """The last tick of the first hyperperiod in which all phases have begun and constant latencies
    are over; the end of a run in which nothing comes round."""
    timeline = system.timeline
    clocks, late = timeline.clocks, [c.latency for c in system.connections if c.latency]
    drawn = any(way.loss or way.max not in (None, way.min) for way in late)
    periods = [c.period for c in clocks if c.period]
    if drawn or len(periods) < len(clocks):
        return timeline.end
    begun = max(c.first % c.longest for c in clocks)
    begun += max((math.ceil(exact(way.min) / timeline.base) for way in late), default=0)
    return min(timeline.end, begun + math.lcm(*periods))
