"""The event loop in C: the clocks' communication points, and the kinds of events."""

from __future__ import annotations

import ctypes
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.ticks import Timeline
from hapticlink.orchestrator.plan.event_kinds import as_array, event, key_of
from hapticlink.orchestrator.plan.operations import Event
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.plan.sample_ages import Delay, delays
from hapticlink.orchestrator.results.run_record import Iterations
from hapticlink.orchestrator.run.compiled import structures
from hapticlink.orchestrator.run.compiled.hold_structures import fill_generator
from hapticlink.orchestrator.run.compiled.operation_records import PATIENCE, Machine
from hapticlink.orchestrator.run.concurrent_fmus import Side
from hapticlink.orchestrator.run.fixed_point import sum_iterations
from hapticlink.orchestrator.run.instructions import instructions
from hapticlink.orchestrator.run.pace import Pace
from hapticlink.orchestrator.run.python_operations import OperationsInPython
from hapticlink.orchestrator.run.simulation import Simulation

WINDOW = 4096
"""Communication points of a clock that the loop gets at a time."""
NEVER = 2**62
Halt = tuple[int, Callable[[], object]]
_NO_HALT: Halt = (0, lambda: None)
NO_HALTS: Iterator[Halt] = iter(())


class Events:
    """Runs all events of a timeline, in real time where there is a pace. block: adds the operations
    of a kind of event, and returns their indices."""

    def __init__(
        self,
        machine: Machine,
        timeline: Timeline,
        block: Callable[[Event], tuple[int, int]],
        pace: Pace | None = None,
        sides: Mapping[str, Side] = MappingProxyType({}),
    ) -> None:
        self._machine, self._timeline, self._block = machine, timeline, block
        self._starts = [clock.starts for clock in timeline.clocks]
        n = len(timeline.clocks)
        clocks, self._key = (structures.Clock * n)(), np.zeros(1 + n, np.int64)
        self._clocks, self._given = [*clocks], [0] * n
        self._kinds: dict[Event, tuple[int, int]] = {}
        self._c = c = structures.Events()
        c.fill(timeline, "end", clocks=clocks, n_clocks=n, key=self._key, patience=PATIENCE)
        c.at.op = -1
        if pace:
            pace.take(machine.library)
            c.fill(pace=pace.c, since=pace.clock())
        for i, clock in enumerate(timeline.clocks):
            self._next_window(i)
            if clock.name in sides:
                self._clocks[i].fill(side=sides[clock.name].c)

    def begin_again(self) -> None:
        """Stand at the first event again, with the kinds of events that are known."""
        c = self._c
        c.fill(tick=0, events=0, kind=0)
        c.at.op = -1
        for i, clock in enumerate(self._clocks):
            if self._given[i]:
                self._given[i] = clock.at = 0
                self._next_window(i)
            clock.fill(at=0, next=0, last=0)

    @property
    def complete(self) -> int:
        """The number of events that are complete."""
        events: int = self._c.events
        return events

    def run(self, turn: Callable[[int], object], halts: Iterator[Halt] = NO_HALTS) -> None:
        """Run all events; `turn` is called from time to time, and at the end, with the tick; what
        belongs to each of `halts`, in the order of their ticks, before the first event then or
        later."""
        c, machine = self._c, self._machine
        loop, here = ctypes.addressof(machine.loop), ctypes.addressof(c)
        c.halt, halted = next(halts, _NO_HALT)
        while code := machine.code(c.at, machine.library.events, loop, here):
            if code == structures.PAUSE:
                turn(c.tick)
            elif code == structures.HALT:
                halted()
                c.halt, halted = next(halts, _NO_HALT)
            else:
                self.serve(code)
        turn(c.tick)

    def serve(self, code: int) -> None:
        """Do what the loop returned for, so that it can go on."""
        if code == structures.KIND:
            self._new_kind()
        elif code == structures.STARTS:
            self._next_window(self._c.at.what)
        else:
            self._machine.serve(code, self._c.at, self._c.tick)

    @property
    def c(self) -> structures.Events:
        """The structure that the loop works on."""
        return self._c

    def has_kinds_of(self, other: Events) -> bool:
        """Whether kinds of events, and their operations, have the same numbers."""
        return [*self._kinds.items()] == [*other._kinds.items()]

    @property
    def next(self) -> int:
        """The tick of the next event, between two."""
        return min(starts[given + c.at] for starts, given, c in self._positions())

    def _positions(self) -> Iterator[tuple[Sequence[int], int, Any]]:
        return zip(self._starts, self._given, self._clocks, strict=True)

    def saved(self) -> dict[str, Any]:
        """Where the clocks stand between two events: the number, and the tick, of the next
        communication point of each, and the tick of its newest event."""
        clocks = zip(self._timeline.clocks, self._positions(), strict=True)
        stand = {
            clock.name: [given + c.at, starts[given + c.at], c.last]
            for clock, (starts, given, c) in clocks
        }
        return {"tick": self._c.tick, "events": self._c.events, "clocks": stand}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Stand where the clocks stood, of which each has the same communication points."""
        self._c.tick, self._c.events = saved["tick"], saved["events"]
        for i, clock in enumerate(self._timeline.clocks):
            self._given[i], _, last = saved["clocks"][clock.name]
            self._clocks[i].fill(at=0, last=last)
            self._next_window(i)

    def previous(self, clock: str) -> int:
        """The communication point (ticks) at which the newest sample of a clock is."""
        last: int = self._clocks[self._index(clock)].last
        return last

    def change_rate(self, clock: str, period: Fraction, jitter: float, seed: int) -> None:
        """Let steps of a clock, from the end of the current one on, end at the first haptic tick
        after whole periods (ticks), each up to half of `jitter` of one before or behind that."""
        whole, rest = divmod(period, 1)
        rest = rest.limit_denominator(2**40)
        rate = structures.Rate(ticks=whole, rest=rest.numerator, parts=rest.denominator)
        rate.fill(haptic=self._timeline.clocks[0].longest, jitter=jitter)
        fill_generator(rate.generator, seed)
        clock_c = self._clocks[self._index(clock)]
        self._machine.library.change_rate(ctypes.addressof(clock_c), ctypes.addressof(rate))

    def restore_rate(self, clock: str) -> None:
        """Let steps of a clock, from the end of the current one on, end where the scene has it, the
        first at least a haptic tick later."""
        i = self._index(clock)
        c, starts = self._clocks[i], self._starts[i]
        current = c.kept["starts"][c.at]
        first = bisect_left(starts, current + self._timeline.clocks[0].longest)
        window = np.array([current, *starts[first : first + WINDOW]], np.int64)
        c.fill(starts=window, n=len(window), at=0)
        c.rate.parts, self._given[i] = 0, first - 1

    def patience(self, ns: int) -> None:
        """Have `turn` called after that time each."""
        self._c.patience = ns

    def _index(self, clock: str) -> int:
        return [c.name for c in self._timeline.clocks].index(clock)

    def _next_window(self, i: int) -> None:
        """The next communication points of clock i: the current one comes first."""
        self._given[i] = first = self._given[i] + self._clocks[i].at
        window = as_array(self._starts[i][first : first + WINDOW])
        if len(window) < 2:
            window = np.array([NEVER, NEVER], np.int64)
        self._clocks[i].fill(starts=window, n=len(window), at=0)

    def _new_kind(self) -> None:
        self.prepare([event(self._timeline, self._key.tobytes())])

    def prepare(self, kinds: Iterable[Event]) -> None:
        """Add the operations of kinds of events, before they occur."""
        self._kinds |= {kind: self._block(kind) for kind in kinds}
        self._machine.publish()
        keys = [key_of(self._timeline, kind) for kind in self._kinds]
        blocks = np.array([*self._kinds.values()], np.int64)
        self._c.fill(keys=np.array(keys, np.int64), kinds=blocks, n_kinds=len(keys))


class CompiledLoop:
    """The loop of a plan.

    events: the clocks and the kinds of events. complete: number of events that are complete.
    in_python: what is carried out in Python, with the reason. change_hold: see Machine.
    """

    def __init__(self, plan: Plan, simulation: Simulation) -> None:
        self._simulation, self.complete = simulation, 0
        self._machine = machine = Machine(simulation)
        self.change_hold, self.in_python = machine.change_hold, machine.in_python
        self._take(plan)

    def _take(self, plan: Plan) -> None:
        self._plan, simulation = plan, self._simulation
        self._delays: dict[int, dict[str, Delay]] = {}
        timeline = plan.system.timeline
        self.events = Events(
            self._machine, timeline, self._block, simulation.pace, simulation.sides
        )

    def take_plan(self, plan: Plan) -> None:
        """Stand at the first event of another plan, for the objects that there are."""
        self._machine.forget_operations()
        self._machine.begin_again()
        self._take(plan)
        self.events.prepare(plan.first_events[1])

    def goes_with(self, other: CompiledLoop) -> bool:
        """Whether both have the same operations, under the same numbers."""
        mine, its = self._machine, other._machine
        return mine.has_operations_of(its) and self.events.has_kinds_of(other.events)

    @property
    def structure(self) -> structures.Loop:
        """What the compiled loop works on."""
        return self._machine.loop

    @property
    def fmus(self) -> list[str]:
        """The FMUs that operations refer to, by number."""
        return self._machine.names("fmu")

    def begin_again(self) -> None:
        """Stand at the first event, with the kinds of events that are known."""
        self._machine.begin_again()
        self.events.begin_again()

    def run(self, turn: Callable[[int], object], halts: Iterator[Halt] = NO_HALTS) -> None:
        """As `Events.run`."""
        watch = self._machine.library.watch
        try:
            watch(True)
            self.events.run(turn, halts)
        finally:
            watch(False)
            self.complete = self.events.complete

    def _block(self, event: Event) -> tuple[int, int]:
        return self._machine.block([*instructions(self._plan.block(event), self._simulation)])

    def delays(self) -> dict[str, Delay]:
        """The ages of the samples in the events that are complete."""
        if self.complete not in self._delays:
            self._delays = {self.complete: delays(self._plan, self.complete)}
        return self._delays[self.complete]

    @property
    def operations(self) -> OperationsInPython:
        return self._machine.operations

    def iterations(self) -> Iterations | None:
        """The counts of all fixed-point iterations together; None where there is none."""
        return sum_iterations(loop.counts for loop in self._machine.operations.loops.values())
