"""Stamps and ages of samples when they are used, and causality: what operations declare of these,
followed through a plan without running FMUs."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.plan.event_kinds import keyed_events
from hapticlink.orchestrator.plan.operations import Event, Place, Stamp
from hapticlink.orchestrator.plan.plan import FIRST, Plan
from hapticlink.orchestrator.system.latency_and_loss import SampleLink
from hapticlink.orchestrator.system.system import System


class Use(NamedTuple):
    """At `tick` the target of `connection` got a value computed from samples that describe instants
    up to `described` (tick)."""

    tick: int
    connection: str
    described: int


def uses(
    plan: Plan, until: int | None = None, connections: Container[str] | None = None
) -> Iterator[Use]:
    """Every value given to every input over the whole run, or up to a tick, in order; of these
    connections alone if they are given."""
    system = plan.system
    traced = {c.name: c for c in system.connections if connections is None or c.name in connections}
    late = ((c.name, c.latency) for c in traced.values() if c.hold)
    early = {c.name for c in traced.values() if c.needs == "step"}
    links = {name: SampleLink(latency, system.timeline.base) for name, latency in late if latency}
    newest: dict[Place, int] = defaultdict(int)
    blocks: dict[Event, list[tuple[Place, Stamp]]] = {}
    for tick, event in plan:
        if until is not None and tick > until:
            return
        if event not in blocks:
            blocks[event] = [
                (place, stamp)
                for place, stamp in _stamps(plan, event)
                if place[0] in ("outputs", "step") or place[1] in traced
            ]
        for (kind, name), stamp in blocks[event]:
            if kind == "held" and name in links:
                for _, _, arrived in links[name].arrived(tick):
                    newest["hold", name] = arrived
            sample = tick + stamp if isinstance(stamp, int) else newest[stamp]
            if kind == "hold" and name in links:
                # A frame is sent when it is over, what describes a later instant at once.
                links[name].send(tick if name in early else max(tick, sample), sample)
            else:
                newest[kind, name] = sample
            if kind == "input":
                yield Use(tick, name, sample)


def _stamps(plan: Plan, kind: Event) -> Iterator[tuple[Place, Stamp]]:
    """The places to which the operations of a kind of event bring samples, in order."""
    for operation in plan.unrolled(kind):
        yield from operation.stamps(plan.system)


@dataclass(frozen=True)
class Delay:
    """Age (s) of the newest sample that an input is computed from, at the time when it is set: the
    time since the instant that the sample describes."""

    min: float
    max: float
    mean: float


def causal(ages: Mapping[str, Delay], system: System) -> bool:
    """Whether no FMU reads a sample that is stamped later than the start of its step, but of a step
    that was taken by then."""
    return all(age.min >= 0 or system.connection[n].needs == "step" for n, age in ages.items())


MAX_EVENTS = 100_000
"""Number of events that are processed without a run if their pattern does not repeat."""


def delays(plan: Plan, events: int = MAX_EVENTS) -> dict[str, Delay]:
    """The ages of the inputs that connections set in the first `events`, until their pattern
    repeats.

    An input is held until it is set again, which adds to the age. The first event is left out,
    since all its samples are of t = 0, and so is what comes before the pattern, unless these events
    end before it.
    """
    system, seconds = plan.system, plan.system.timeline.seconds
    until, (ticks, kinds) = pattern_end(system), plan.first_events
    if (n := min(events, int(np.searchsorted(ticks, until, "right")))) < FIRST:
        ticks, kinds = ticks[:n], {k: rows[rows < n] for k, rows in kinds.items() if rows[0] < n}
    else:
        ticks, kinds = keyed_events(system.timeline, until, events)
    last = int(ticks[-1]) if len(ticks) else 0
    begun = begun if (begun := _pattern_begin(system)) < last else 0
    late = {c.name for c in system.connections if c.latency}
    found = {name: ages for name, ages in _ages(plan, ticks, kinds, begun) if name not in late}
    drawn: dict[str, list[int]] = defaultdict(list)
    for tick, connection, stamp in uses(plan, last, late) if late and last else ():
        if tick > begun:
            drawn[connection].append(tick - stamp)
    found |= {name: np.array(ages) for name, ages in drawn.items()}
    each = {id(a): a for a in found.values() if len(a)}
    told = {
        i: Delay(seconds(int(a.min())), seconds(int(a.max())), seconds(int(a.sum())) / len(a))
        for i, a in each.items()
    }
    return {name: told[id(a)] for name, a in found.items() if id(a) in told}


Left = tuple[tuple[int, Stamp], ...]
"""The stamps that kinds of events, by number, leave in a place."""


def _ages(
    plan: Plan, ticks: NDArray[np.int64], kinds: Mapping[Event, NDArray[np.intp]], begun: int
) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """By connection the ages (ticks) of its inputs in the events after a tick: what each kind of
    event leaves in the places is found once, and goes on from event to event for all of them at
    once; one array for all connections of the same ages. Without latencies, of which each sample
    has its own."""
    left: dict[Place, Left] = defaultdict(tuple)
    used: dict[str, list[tuple[int, Stamp]]] = {}
    for number, kind in enumerate(kinds):
        now: dict[Place, Stamp] = {}
        for place, stamp in _stamps(plan, kind):
            now[place] = stamp if isinstance(stamp, int) else now.get(stamp, stamp)
            if place[0] == "input" and not kind.first:
                used.setdefault(place[1], []).append((number, now[place]))
        for place, stamp in now.items():
            left[place] += ((number, stamp),)
    rows_of = [*kinds.values()]
    counted = [rows[ticks[rows] > begun] for rows in rows_of]

    known: dict[Left, NDArray[np.int64]] = {}

    def of(stamp: int | Left, rows: NDArray[np.intp], again: Any) -> NDArray[np.int64]:
        # `again` is this function: one that refers to itself stays until cycles are searched.
        if isinstance(stamp, int):
            return ticks[rows] + stamp
        if stamp not in known:
            after, newest = np.zeros(len(ticks) + 1, np.int64), np.zeros(len(ticks) + 1, np.intp)
            for number, own in stamp:
                here = rows_of[number]
                after[here + 1] = again(own if isinstance(own, int) else left[own], here, again)
                newest[here + 1] = here + 1
            known[stamp] = after[np.maximum.accumulate(newest)]
        return known[stamp][rows]

    @cache
    def ages(*each: tuple[int, int | Left]) -> NDArray[np.int64]:
        return np.concatenate([ticks[counted[i]] - of(stamp, counted[i], of) for i, stamp in each])

    for name, each in used.items():
        yield name, ages(*((i, s if isinstance(s, int) else left[s]) for i, s in each))


def pattern_end(system: System) -> int:
    """The last tick of the first hyperperiod that begins after all phases and constant latencies;
    the end of the run if the pattern of events does not repeat."""
    timeline, ways = system.timeline, (c.latency for c in system.connections if c.latency)
    drawn = any(way.loss or way.max not in (None, way.min) for way in ways)
    periods = [c.period for c in timeline.clocks if c.period]
    if drawn or len(periods) < len(timeline.clocks):
        return timeline.end
    return min(timeline.end, _pattern_begin(system) + math.lcm(*periods))


def _pattern_begin(system: System) -> int:
    """The tick from which on the pattern of samples repeats, where it does: after all phases and
    constant latencies, and after the first frames, whose samples describe t = 0 as those before.
    A clock without a period has no phase."""
    timeline = system.timeline
    clocks, late = timeline.clocks, [c.latency for c in system.connections if c.latency]
    begun = max((c.first % c.period for c in clocks if c.period), default=0)
    begun += max((timeline.clock(u.clock).longest for u in system.fmus if u.frames), default=0)
    return begun + max((math.ceil(exact(way.min) / timeline.base) for way in late), default=0)
