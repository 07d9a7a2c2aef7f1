"""What a program has in store for changes while it runs: other holds of its connections, and events
at other rates of the graphics clock."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.holds.table import TABLE
from hapticlink.orchestrator.plan.event_kinds import key_of
from hapticlink.orchestrator.plan.operations import Event, Firing, Record
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold
from hapticlink.orchestrator.run.compiled.operation_records import Machine
from hapticlink.orchestrator.run.instructions import instructions
from hapticlink.orchestrator.run.simulation import Simulation
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.system.changes import (
    choices_of_slower,
    require_other_rate,
    with_hold,
)

CLOCK = "graphics"
LEAST_RATE, MOST_DELAY = 1.0, 0.1
"""Hz, s: to which a program can be changed."""
SPARE_KINDS = 32
"""Kinds of events that a program keeps beside those of its scene, the oldest of which gives way."""
FIELDS = ("b", "c", "d", "x")
"""The numbers of an operation that can depend on the length of a step."""


@dataclass(frozen=True)
class Choice:
    """A hold that a connection can have."""

    connection: str
    hold: str


@dataclass(frozen=True)
class Family:
    """Kinds of events in which the clock starts a step of any length, and all others are as in
    `key`: for a step of `dticks` the `n` operations from `first` on, whose FIELDS grow by `slopes`
    with each further tick."""

    key: list[int]
    first: int
    n: int
    dticks: int
    slopes: list[tuple[float, ...]]


@dataclass(frozen=True)
class PreparedChanges:
    """choices: in the order of the array of their structures, at `address`. clock: the index of
    that whose rate can be changed, -1 if there is none. spare: the index of the first operation of
    `most` for each spare kind."""

    choices: list[Choice]
    address: int
    clock: int = -1
    families: tuple[Family, ...] = ()
    spare: int = 0
    most: int = 0
    kept: object = None

    @property
    def n_kinds(self) -> int:
        """The number of spare kinds."""
        return SPARE_KINDS if self.families else 0


NONE = PreparedChanges([], 0)
"""Of a program that stays as its scene has it."""


def prepare_changes(
    machine: Machine, simulation: Simulation, plan: Plan, kinds: Iterable[Event]
) -> PreparedChanges:
    """The changes that are possible in a scene. kinds: of its events."""
    held = [*_holds(simulation)]
    pointers = (ctypes.c_void_p * max(len(held), 1))(*(hold.address for _, hold in held))
    possible = PreparedChanges(
        [choice for choice, _ in held], ctypes.addressof(pointers), kept=(pointers, held)
    )
    names = [clock.name for clock in simulation.system.timeline.clocks]
    if CLOCK not in names[1:]:
        return possible
    try:
        require_other_rate(simulation.system, CLOCK)
    except InputFault:
        return possible
    timeline, index = simulation.system.timeline, names.index(CLOCK)
    families = []
    for event in _with_clock(kinds, timeline, index):
        family = _family(machine, simulation, plan, event)
        if family is None:
            return possible
        families.append(family)
    most = max(family.n for family in families)
    first, _ = machine.block([Record(CLOCK)] * (SPARE_KINDS * most))
    return replace(possible, clock=index, families=tuple(families), spare=first, most=most)


def _holds(simulation: Simulation) -> Iterator[tuple[Choice, CompiledHold]]:
    """The holds that connections can have, each with the connection's own latency, or as if it had
    one."""
    system = simulation.system
    haptic = system.timeline.clocks[0].shortest * system.timeline.base
    for name, holds in choices_of_slower(system).items():
        connection = system.connection[name]
        latency = connection.latency or Latency(min=MOST_DELAY)
        for hold in holds:
            other = replace(with_hold(connection, hold, None), latency=latency)
            if hold in TABLE:  # no hold of a plugin
                new = simulation.make_hold(other)
                longest = MOST_DELAY + (1 / LEAST_RATE if new.account else 0.0)
                while new.room < math.ceil(longest / haptic) + 8:
                    new.grow()
                yield Choice(name, hold), new


def _with_clock(kinds: Iterable[Event], timeline: Timeline, index: int) -> Iterator[Event]:
    """The kinds of events in which the clock fires beside any of the others, with a step of one
    tick."""
    found: dict[Event, None] = {}
    for kind in kinds:
        others = {f.clock: f for f in kind.firings if f.clock != CLOCK}
        for fired in (others, {}):
            given = fired | {CLOCK: Firing(CLOCK, 1, False)}
            firings = tuple(given[c.name] for c in timeline.clocks if c.name in given)
            found.setdefault(Event(kind.first and bool(fired), firings))
    yield from found


def _family(machine: Machine, simulation: Simulation, plan: Plan, event: Event) -> Family | None:
    """The operations of an event as a function of the length of the clock's step; None where they
    are not linear in it."""
    blocks = []
    for dticks in (1, 2, 4):
        firings = tuple(f._replace(dticks=dticks) if f.clock == CLOCK else f for f in event.firings)
        block = plan.block(event._replace(firings=firings))
        first, last = machine.block([*instructions(block, simulation)])
        blocks.append((first, last - first))
    sizes = {n for _, n in blocks}
    if len(sizes) > 1:
        return None
    (n,) = sizes
    machine.publish()
    every = [(structures.Op * n).from_address(_op(machine, first)) for first, _ in blocks]
    slopes = []
    for one, two, four in zip(*every, strict=True):
        if (one.code, one.a) != (two.code, two.a) or one.code == structures.BLEND:
            return None
        slopes.append(tuple(getattr(two, f) - getattr(one, f) for f in FIELDS))
        grown = [getattr(one, f) + 3 * s for f, s in zip(FIELDS, slopes[-1], strict=True)]
        if any(abs(g - getattr(four, f)) > 1e-12 for f, g in zip(FIELDS, grown, strict=True)):
            return None
    return Family(key_of(plan.system.timeline, event), blocks[0][0], n, 1, slopes)


def _op(machine: Machine, index: int) -> int:
    return int(machine.loop.ops) + index * ctypes.sizeof(structures.Op)
