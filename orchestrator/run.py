"""A plan carried out: operations bound to calls once, then one loop over events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

import numpy as np

from hapticlink.orchestrator import interrupt
from hapticlink.orchestrator.board import Board
from hapticlink.orchestrator.conditions import COMPARISONS
from hapticlink.orchestrator.faults import Fault, Interrupted
from hapticlink.orchestrator.fmu import Instance
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.initialize import initialize
from hapticlink.orchestrator.plan import Plan
from hapticlink.orchestrator.results import Recorder
from hapticlink.orchestrator.schemes.operations import (
    Evaluate,
    Event,
    Get,
    Operation,
    Push,
    Record,
    Set,
    Step,
    StopWhen,
)

Call = Callable[[int], object]
Progress = Callable[[float], None]


class _Stop(Exception):
    """The stop condition holds."""


@dataclass
class Outcome:
    """How a run ended: `fault` is None for a good end, end_time the last recorded row's time;
    times in s, counts by FMU and call."""

    end_time: float = 0.0
    reason: str = "duration"
    fault: Fault | None = None
    wall_time: float = 0.0
    step_time: dict[str, float] = field(default_factory=dict)
    calls: dict[str, dict[str, int]] = field(default_factory=dict)


def run(plan: Plan, folder: Path, progress: Progress | None = None) -> Outcome:
    """Run to the end or to the first fault; what was recorded until then is in `folder`.

    progress is told the simulated time (s) now and then.
    """
    outcome = Outcome()
    runner: _Runner | None = None
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
        outcome.fault, outcome.reason = Fault(f"{folder}: {error}"), "fault"
    finally:
        outcome.wall_time = perf_counter() - begin
        if runner:
            outcome.end_time = runner.recorders[plan.system.timeline.clocks[0].name].last
            outcome.step_time = {n: i.step_time for n, i in runner.instances.items()}
            outcome.calls = runner.counts()
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
        self._bound: dict[Event, list[Call]] = {}
        self._events: Counter[Event] = Counter()
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
        for unit in self.system.units:
            view = values[self.board.unit(unit.name)]
            instance = Instance(unit.name, unit.description, view)
            self.instances[unit.name] = stack.enter_context(instance)
        self._connections = {c.name: c for c in self.system.connections}
        self._holds = {
            c.name: HOLDS[c.hold](len(c.inputs)) for c in self.system.connections if c.hold
        }

    def start(self) -> None:
        """Initialise; every hold gets its sample of t = 0, every FMU its way to set inputs."""
        initialize(self.system, self.instances, self.board)
        values = self.board.values
        for name, hold in self._holds.items():
            hold.push(0, values[self.board.sources(self._connections[name])])
        self._setters = {}
        for unit in self.system.units:
            incoming = self.system.into(unit.name)
            scalars = [s for c in incoming for s in c.inputs]
            places = [p for c in incoming for p in self.board.places(c)]
            if incoming:
                self._setters[unit.name] = self.instances[unit.name].connect(scalars, places)

    def calls(self, event: Event) -> list[Call]:
        self._events[event] += 1
        if (found := self._bound.get(event)) is None:
            found = self._bound[event] = [self._bind(op) for op in self.plan.block(event)]
        return found

    def counts(self) -> dict[str, dict[str, int]]:
        """FMI calls of the loop, by FMU and kind; those of blocks that a fault cut are in it."""
        totals: dict[str, Counter[str]] = {name: Counter() for name in self.instances}
        for event, times in self._events.items():
            for operation in self.plan.block(event):
                if isinstance(operation, Get | Set | Step):
                    totals[operation.fmu][type(operation).__name__.lower()] += times
        return {name: dict(sorted(counter.items())) for name, counter in totals.items()}

    # --- one way to bind each operation -----------------------------------------------------

    def _bind(self, operation: Operation) -> Call:
        match operation:
            case Get(fmu):
                get = self.instances[fmu].get
                return lambda tick: get()
            case Set(fmu):
                set_from, values = self._setters[fmu], self.board.values
                return lambda tick: set_from(values)
            case Step(fmu, dticks):
                return self._step(fmu, dticks)
            case Push(connection):
                return self._push(connection)
            case Evaluate(connection):
                return self._evaluate(connection)
            case Record(clock):
                row, seconds = self.recorders[clock].row, self.seconds
                return lambda tick: row(seconds(tick))
            case StopWhen():
                return self._stop_when()

    def _step(self, fmu: str, dticks: int) -> Call:
        step, seconds = self.instances[fmu].step, self.seconds
        size = seconds(dticks)
        # A sampled output is stamped at the start of its step.
        valid = 0 if self.system.unit[fmu].sampled else dticks
        return lambda tick: step(seconds(tick), seconds(tick + valid), size)

    def _push(self, connection: str) -> Call:
        hold, values = self._holds[connection], self.board.values
        sources = self.board.sources(self._connections[connection])
        contiguous = sources == list(range(sources[0], sources[-1] + 1))
        view = values[sources[0] : sources[-1] + 1]
        if contiguous:
            return lambda tick: hold.push(tick, view)
        return lambda tick: hold.push(tick, values[sources])

    def _evaluate(self, connection: str) -> Call:
        hold, view = self._holds[connection], self.board.values[self.board.hold(connection)]

        def evaluate(tick: int) -> None:
            view[:] = hold.value(tick)

        return evaluate

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
