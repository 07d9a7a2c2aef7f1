"""Ages of samples when they are used, and causality, derived from a plan."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.plan.event_kinds import keyed_events
from hapticlink.orchestrator.plan.operations import Blend, Evaluate, Event, Get, Push, Set
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.stamps import uses
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


MAX_EVENTS = 100_000
"""Number of events that are processed without a run if their pattern does not repeat."""


def delays(plan: Plan, events: int = MAX_EVENTS) -> dict[str, Delay]:
    """The ages of the inputs that connections set in the first `events`, until their pattern
    repeats.

    An input is held until it is set again, which adds to the age. The first event is left out,
    since all its samples are of t = 0.
    """
    system, seconds = plan.system, plan.system.timeline.seconds
    ticks, kinds = keyed_events(system.timeline, pattern_end(system), events)
    found: dict[str, list[NDArray[np.int64]]] = {}
    late = {c.name for c in system.connections if c.latency}
    for connection, ages in _ages(plan, ticks, kinds):
        if connection not in late:
            found.setdefault(connection, []).append(ages)
    for tick, connection, stamp in uses(plan, int(ticks[-1]), late) if late and len(ticks) else ():
        if tick:
            found.setdefault(connection, []).append(np.array([tick - stamp]))
    joined = {name: np.concatenate(parts) for name, parts in found.items()}
    return {
        name: Delay(seconds(int(a.min())), seconds(int(a.max())), seconds(int(a.sum())) / len(a))
        for name, a in joined.items()
    }


Register = tuple[str, str]
"""What an event leaves for later ones: the newest sample that was "got" of an FMU, "pushed" to the
hold of a connection, or is in its value that is "held"."""
Stamp = int | Register
"""A stamp in a block of operations: so many ticks after the event, or that which a register has
before the event."""


def _ages(
    plan: Plan, ticks: NDArray[np.int64], kinds: Mapping[Event, NDArray[np.intp]]
) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """By connection, the ages (ticks) of its inputs in events of each kind: what blocks leave in
    the registers is found once a kind, and goes on from event to event for all of them at once.
    Without latencies, of which each sample has its own."""
    left: dict[Register, dict[Event, Stamp]] = {}
    used: dict[Event, list[tuple[str, Stamp]]] = {}
    for kind in kinds:
        block, used[kind] = _stamps(plan, kind)
        for register, stamp in block.items():
            left.setdefault(register, {})[kind] = stamp

    @cache
    def before(register: Register) -> NDArray[np.int64]:
        after, newest = np.zeros(len(ticks) + 1, np.int64), np.zeros(len(ticks) + 1, np.intp)
        for kind, stamp in left.get(register, {}).items():
            after[kinds[kind] + 1] = of(stamp, kinds[kind])
            newest[kinds[kind] + 1] = kinds[kind] + 1
        stamps: NDArray[np.int64] = after[np.maximum.accumulate(newest)]
        return stamps

    def of(stamp: Stamp, rows: NDArray[np.intp]) -> NDArray[np.int64]:
        return ticks[rows] + stamp if isinstance(stamp, int) else before(stamp)[rows]

    for kind, rows in kinds.items():
        for connection, stamp in () if kind.first else used[kind]:
            yield connection, ticks[rows] - of(stamp, rows)


def _stamps(plan: Plan, kind: Event) -> tuple[dict[Register, Stamp], list[tuple[str, Stamp]]]:
    """What a block leaves in the registers, and the inputs that it sets, by connection."""
    system = plan.system
    now: dict[Register, Stamp] = {}
    used: list[tuple[str, Stamp]] = []

    def newest(*register: str) -> Stamp:
        kind, name = register
        return now.get((kind, name), (kind, name))

    for operation in plan.unrolled(kind):
        match operation:
            case Get(fmu, ahead):
                now["got", fmu] = ahead
            case Push(name, ahead):
                now["pushed", name] = ahead or newest("got", system.connection[name].source)
            case Evaluate(name) | Blend(name):
                now["held", name] = newest("pushed", name)
            case Set(fmu, at_once):
                for c in system.into(fmu):
                    held = c.hold and not at_once
                    stamp = newest("held", c.name) if held else newest("got", c.source)
                    used.append((c.name, stamp))
    return now, used


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
