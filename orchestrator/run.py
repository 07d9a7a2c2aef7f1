"""A plan carried out: operations bound to calls once, then one loop over events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from time import perf_counter

import numpy as np

from hapticlink.orchestrator import interrupt
from hapticlink.orchestrator.advance import Advancer
from hapticlink.orchestrator.board import Board
from hapticlink.orchestrator.conditions import COMPARISONS
from hapticlink.orchestrator.energy import Energy
from hapticlink.orchestrator.faults import Fault, Interrupted
from hapticlink.orchestrator.fmu import Instance
from hapticlink.orchestrator.holding import make_hold
from hapticlink.orchestrator.initialize import initialize
from hapticlink.orchestrator.instances import instance, isolated
from hapticlink.orchestrator.latency import Late
from hapticlink.orchestrator.loops import Iterations, Loop, total
from hapticlink.orchestrator.meters import Meters
from hapticlink.orchestrator.plan import Plan
from hapticlink.orchestrator.results import Recorder
from hapticlink.orchestrator.schemes.operations import (
    Advance,
    Blend,
    Evaluate,
    Event,
    Get,
    Operation,
    Part,
    Push,
    Record,
    Repeat,
    Rollback,
    Save,
    Set,
    Step,
    StopWhen,
)
from hapticlink.orchestrator.step_control import Steps

Call = Callable[[int], object]
Progress = Callable[[float], None]


class _Stop(Exception):
    """The stop condition holds."""


@dataclass
class Outcome:
    """How a run ended: `fault` is None for a good end, end_time the last recorded row's time;
    times in s, counts by FMU and call. isolated says why an FMU ran in a process of its own, held
    how often an output was held for not being finite, smaller_steps how many were retried."""

    end_time: float = 0.0
    reason: str = "duration"
    fault: Fault | None = None
    wall_time: float = 0.0
    step_time: dict[str, float] = field(default_factory=dict)
    calls: dict[str, dict[str, int]] = field(default_factory=dict)
    isolated: dict[str, str] = field(default_factory=dict)
    held: dict[str, int] = field(default_factory=dict)
    smaller_steps: dict[str, int] = field(default_factory=dict)
    energies: dict[str, Energy] = field(default_factory=dict)
    links: dict[str, dict[str, int]] = field(default_factory=dict)
    iterations: Iterations | None = None
    steps: dict[str, Steps] = field(default_factory=dict)


def run(plan: Plan, folder: Path, progress: Progress | None = None) -> Outcome:
    """Run to the end or to the first fault; what was recorded until then is in `folder`.

    progress is told the simulated time (s) now and then.
    """
    outcome = Outcome()
    runner: _Runner | None = None

    def last() -> float:
        return runner.recorders[plan.system.timeline.clocks[0].name].last if runner else 0.0

    begin = perf_counter()
    try:
        # Values that are not finite are found by 0 x NaN, without numpy's own warning.
        with ExitStack() as stack, np.errstate(invalid="ignore"):
            runner = _Runner(plan, folder, stack)
            interrupted = stack.enter_context(interrupt.watch())
            runner.start()
            begin = perf_counter()
            for count, (tick, event) in enumerate(plan):
                for call in runner.calls(event):
                    call(tick)
                if interrupted:
                    raise Interrupted(runner.seconds(tick))
                if progress and not count % 64:
                    progress(runner.seconds(tick))
    except _Stop:
        outcome.reason = "stop_when"
    except Fault as fault:
        outcome.reason, outcome.fault = (
            "interrupted" if isinstance(fault, Interrupted) else "fault",
            fault,
        )
    except OSError as error:  # a full disk, most of all
        outcome.fault, outcome.reason = Fault(f"{folder}: {error.strerror or error}"), "fault"
    except KeyboardInterrupt:  # a second signal does not wait for the end of the event
        outcome.fault, outcome.reason = Interrupted(last()), "interrupted"
    finally:
        outcome.wall_time = perf_counter() - begin
        if runner:
            outcome.end_time = last()
            outcome.step_time = {n: i.step_time for n, i in runner.instances.items()}
            outcome.calls = runner.counts()
            outcome.isolated = runner.isolated
            outcome.held = {n: i.held for n, i in runner.instances.items() if i.held}
            smaller = {n: i.smaller_steps for n, i in runner.instances.items()}
            outcome.smaller_steps = {n: s for n, s in smaller.items() if s}
            outcome.energies = runner.meters.energies()
            outcome.links = runner.links()
            outcome.steps = {clock: a.steps for clock, a in runner.advancers.items()}
            outcome.iterations = total(loop.counts for loop in runner.loops.values())
    if progress:
        progress(outcome.end_time)
    return outcome


class _Runner:
    """The live side of a plan: instances, board, holds and recorders."""

    def __init__(self, plan: Plan, folder: Path, stack: ExitStack) -> None:
        self.plan, self.system = plan, plan.system
        self.board = Board(self.system)
        self.seconds = self.system.timeline.seconds
        self.instances: dict[str, Instance] = {}
        self._bound: dict[Event | Part, list[Call]] = {}
        self._events: Counter[Event | Part] = Counter()
        values = self.board.values
        self.recorders = {
            c.name: stack.enter_context(
                Recorder(
                    folder / f"{c.name}.csv",
                    self.board.columns(c.name),
                    values[self.board.clock(c.name)],
                )
            )
            for c in self.system.timeline.clocks
        }
        self.isolated = isolated(self.system.units)
        for unit in self.system.units:
            view = values[self.board.unit(unit.name)]
            made = instance(unit, view, self.system.faults, unit.name in self.isolated)
            self.instances[unit.name] = stack.enter_context(made)
        self._connections = {c.name: c for c in self.system.connections}
        self.loops: dict[Repeat, Loop] = {}
        self.advancers: dict[str, Advancer] = {}
        self._holds = {
            c.name: make_hold(c, self.system, self.board) for c in self.system.connections if c.hold
        }
        self.meters = Meters(self.system, self.board)

    def start(self) -> None:
        """Initialise; every hold gets its sample of t = 0, every FMU its way to set inputs."""
        initialize(self.system, self.instances, self.board)
        values = self.board.values
        for name, hold in self._holds.items():
            hold.push(0, values[self.board.sources(self._connections[name])], 0)
        self.meters.start()
        self._setters = {}
        self._now = {}
        for unit in self.system.units:
            incoming = self.system.into(unit.name)
            scalars = [s for c in incoming for s in c.inputs]
            places = [p for c in incoming for p in self.board.places(c)]
            if incoming:
                self._setters[unit.name] = self.instances[unit.name].connect(scalars, places)
            if incoming and unit.name in self.system.get_after_set:
                places = [p for c in incoming for p in self.board.sources(c)]
                self._now[unit.name] = self.instances[unit.name].connect(scalars, places)

    def calls(self, event: Event | Part) -> list[Call]:
        self._events[event] += 1
        if (found := self._bound.get(event)) is None:
            found = self._bound[event] = [self._bind(op) for op in self.plan.block(event)]
        return found

    def counts(self) -> dict[str, dict[str, int]]:
        """FMI calls of the loop, by FMU and kind; those of blocks that a fault cut are in it."""
        totals: dict[str, Counter[str]] = {name: Counter() for name in self.instances}
        ran: list[tuple[Operation, int]] = []
        for event, times in self._events.items():
            ran += [(op, times) for op in self.plan.block(event)]
        for repeat, loop in self.loops.items():
            ran += [(op, loop.counts.iterations) for op in repeat.body]
            ran += [(op, loop.counts.rollbacks) for op in repeat.again]
        for op, times in ran:
            if isinstance(op, Get | Set | Step | Save | Rollback):
                totals[op.fmu][type(op).__name__.lower()] += times
        return {name: dict(sorted(counter.items())) for name, counter in totals.items()}

    def links(self) -> dict[str, dict[str, int]]:
        """What became of the samples of connections with a latency."""
        late = {n: h.link for n, h in self._holds.items() if isinstance(h, Late)}
        return {
            n: {"sent": k.sent, "lost": k.lost, "overtaken": k.overtaken} for n, k in late.items()
        }

    # --- one way to bind each operation -----------------------------------------------------

    def _bind(self, operation: Operation) -> Call:
        match operation:
            case Get(fmu, ahead):
                get = self.instances[fmu].get
                return self.meters.read(fmu, ahead, get)
            case Set(fmu, now):
                set_from, values = (self._now if now else self._setters)[fmu], self.board.values
                if now:
                    return lambda tick: set_from(values)
                return self.meters.fed(fmu, lambda tick: set_from(values))
            case Step(fmu, dticks, part, parts):
                return self._step(fmu, dticks, part, parts)
            case Push(connection, ahead):
                return self._push(connection, ahead)
            case Evaluate(connection, ahead):
                return self._evaluate(connection, float(ahead))
            case Blend(connection, points):
                return self._blend(connection, points)
            case Save(fmu):
                save = self.instances[fmu].save
                return lambda tick: save()
            case Rollback(fmu):
                rollback = self.instances[fmu].rollback
                return lambda tick: rollback()
            case Advance(clock, dticks):
                advance = self._advancer(clock).advance
                return lambda tick: advance(tick, dticks)
            case Repeat():
                return self._repeat(operation)
            case Record(clock):
                row, seconds = self.recorders[clock].row, self.seconds
                return lambda tick: row(seconds(tick))
            case StopWhen():
                return self._stop_when()

    def _step(self, fmu: str, dticks: int, part: int, parts: int) -> Call:
        step, seconds = self.instances[fmu].step, self.seconds
        size = seconds(dticks)
        # A sampled output is stamped at the start of its step.
        valid = 0 if self.system.unit[fmu].sampled else dticks
        if parts > 1:
            base = self.system.timeline.base / parts
            begin, size = part * dticks, float(dticks * base)

            def substep(tick: int) -> None:
                start = tick * parts + begin
                step(float(start * base), float((start + dticks) * base), size)

            return substep
        return lambda tick: step(seconds(tick), seconds(tick + valid), size)

    def _push(self, connection: str, ahead: int) -> Call:
        hold, values = self._holds[connection], self.board.values
        sources = self.board.sources(self._connections[connection])
        view = self.board.view(sources)
        if view is not None:
            return lambda tick: hold.push(tick + ahead, view, tick)
        return lambda tick: hold.push(tick + ahead, values[sources], tick)

    def _evaluate(self, connection: str, ahead: float) -> Call:
        hold, view = self._holds[connection], self.board.values[self.board.hold(connection)]

        def evaluate(tick: int) -> None:
            view[:] = hold.value(tick, ahead)

        return evaluate

    def _advancer(self, clock: str) -> Advancer:
        if clock not in self.advancers:
            self.advancers[clock] = Advancer(
                clock,
                self.system,
                self.board,
                self.instances,
                self._holds,
                self.meters,
                self.calls,
            )
        return self.advancers[clock]

    def _blend(self, connection: str, points: tuple[tuple[float, Fraction], ...]) -> Call:
        hold, view = self._holds[connection], self.board.values[self.board.hold(connection)]
        pairs = [(weight, float(ahead)) for weight, ahead in points]

        def blend(tick: int) -> None:
            view[:] = sum(weight * hold.value(tick, ahead) for weight, ahead in pairs)

        return blend

    def _repeat(self, operation: Repeat) -> Loop:
        """The loop of a Repeat; events share it, and what its solver has learned."""
        if operation in self.loops:
            return self.loops[operation]
        body = [
            self.meters.read(op.fmu, op.ahead, self.instances[op.fmu].read)
            if isinstance(op, Get)
            else self._bind(op)
            for op in operation.body
        ]
        guess, again = (
            [self._bind(op) for op in ops] for ops in (operation.guess, operation.again)
        )
        calls = (guess, body, again)
        loop = Loop(operation, self.system, self.board, self._holds, calls, self.meters)
        self.loops[operation] = loop
        return loop

    def _stop_when(self) -> Call:
        condition = self.system.ends_when
        assert condition is not None
        place = self.board.scalar(condition.fmu, condition.variable)
        holds, values = COMPARISONS[condition.comparison], self.board.values
        limit = condition.value

        def stop_when(tick: int) -> None:
            if holds(values[place], limit):
                raise _Stop

        return stop_when
