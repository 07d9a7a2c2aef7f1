"""The plan: what happens at each event, as plain data.

An event is an instant at which clocks fire. Events of one kind run the same block of
operations, so a plan is a finite set of blocks and an iterator of (tick, event). A scheme
orders a block; `run` executes it; `sample_ages` derives causality from it.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby, pairwise
from typing import NamedTuple

from hapticlink.orchestrator.base.errors import InputFault, shorten
from hapticlink.orchestrator.base.ticks import Clock, Timeline
from hapticlink.orchestrator.plan import dependency_order
from hapticlink.orchestrator.plan.dependency_order import AlgebraicLoop
from hapticlink.orchestrator.plan.event_kinds import KeyedEvents, keyed_events
from hapticlink.orchestrator.plan.operations import (
    Event,
    Firing,
    Operation,
    Record,
    Step,
    flat,
)
from hapticlink.orchestrator.plan.schemes import SCHEMES
from hapticlink.orchestrator.system.system import System

Block = tuple[Operation, ...]
FIRST = 4096
"""Events whose kinds are known before a run."""
EXACT = 2**53
"""Up to here every whole number is a double, and the quotient of two is rounded once."""


class Moment(NamedTuple):
    tick: int
    event: Event


@dataclass
class Plan:
    """The blocks of a system's events, created at the first event of each kind. Iteration gives
    the events with their ticks."""

    system: System
    _blocks: dict[Event, Block] = field(default_factory=dict)

    def block(self, kind: Event) -> Block:
        """The operations of a kind of event in the order of the coupling scheme. Raises InputFault
        for a scheme of a plugin that gives anything else."""
        if kind not in self._blocks:
            coupling = self.system.coupling.scheme
            block = SCHEMES[coupling].block(self.system, kind)
            if not isinstance(block, tuple) or not all(isinstance(op, Operation) for op in block):
                what = shorten(repr(block))
                raise InputFault(f"coupling = {coupling!r}: {what} is no tuple of operations")
            self._blocks[kind] = block
        return self._blocks[kind]

    @cached_property
    def first_events(self) -> KeyedEvents:
        """The first events of a run, FIRST at most."""
        return keyed_events(self.system.timeline, self.system.timeline.end, FIRST)

    def check(self) -> None:
        """Raises InputFault if the scheme cannot order the FMUs, or leaves out the step of one or
        the rows of a clock, and for times that are not exact. The first event suffices, since all
        clocks fire there."""
        _require_exact_times(self.system)
        event = next(iter(self)).event
        operations = tuple(self.unrolled(event))
        stepped = {op.fmu for op in operations if isinstance(op, Step)}
        recorded = {op.table for op in operations if isinstance(op, Record)}
        going = {f.clock for f in event.firings if not f.final}
        left = [u.name for u in self.system.fmus if u.clock in going and u.name not in stepped]
        left += [f"the rows of {f.clock}" for f in event.firings if f.clock not in recorded]
        if left:
            raise InputFault(
                f"coupling = {self.system.coupling.scheme!r} leaves out {', '.join(left)}"
            )

    def loops(self) -> tuple[AlgebraicLoop, ...]:
        """The algebraic loops among FMUs that the scheme puts in an order, in that order."""
        ordered = SCHEMES[self.system.coupling.scheme].ordered(self.system)
        return tuple(dependency_order.loops(self.system, ordered))

    def unrolled(self, event: Event) -> Iterator[Operation]:
        """The operations of `event`, with one iteration of each Repeat."""
        return flat(self.block(event))

    def __iter__(self) -> Iterator[Moment]:
        return moments(self.system.timeline)


def _require_exact_times(system: System) -> None:
    """Raises InputFault where the loop's times, of `Timeline.time` with substeps as parts, would be
    rounded more than once."""
    timeline, parts = system.timeline, max(system.coupling.substeps.values(), default=1)
    base, last = timeline.base, timeline.end + max(c.longest for c in timeline.clocks)
    numerator, begin, denominator = timeline.ratio
    largest = max(last * numerator + begin, denominator) * parts
    if largest >= EXACT:
        since = f" from {float(timeline.begin):g} s on" if begin else ""
        raise InputFault(
            f"its {timeline.end} ticks of {base} s{since}, times {parts} substeps, are "
            f"{largest:.3g} and not below 2^53, up to which times are exact: take a shorter "
            "duration, or rates whose periods have a longer common divisor"
        )


def moments(timeline: Timeline) -> Iterator[Moment]:
    """All events from 0 to the end in order; clocks that fire at the same tick share one."""
    merged = heapq.merge(*(_firings(i, c, timeline.end) for i, c in enumerate(timeline.clocks)))
    for tick, firing in groupby(merged, key=lambda entry: entry[0]):
        yield Moment(tick, Event(tick == 0, tuple(entry[2] for entry in firing)))


def _firings(order: int, clock: Clock, end: int) -> Iterator[tuple[int, int, Firing]]:
    """The firings of a clock; a step that would end after the end of the run is `final`: it is not
    taken, but its row is written."""
    for start, after in pairwise(clock.starts):
        if start > end:
            return
        dticks = after - start
        yield start, order, Firing(clock.name, dticks, start + dticks > end)
