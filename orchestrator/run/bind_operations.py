"""Binds the operations of a plan to the calls that execute them.

A bound operation is a function of the event's tick. Slices of the signal vector and instants are
resolved once, when an operation is bound, so that the event loop calls no more than is necessary.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from fractions import Fraction

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.holds import Hold
from hapticlink.orchestrator.plan.operations import (
    Blend,
    Evaluate,
    Get,
    Operation,
    Push,
    Record,
    Repeat,
    Rollback,
    Save,
    Set,
    Step,
    StopWhen,
)
from hapticlink.orchestrator.run.fixed_point import FixedPoint
from hapticlink.orchestrator.run.instructions import (
    Collect,
    Feed,
    Finish,
    Instruction,
    Move,
    Sample,
    instructions,
)
from hapticlink.orchestrator.run.simulation import Call, Simulation
from hapticlink.orchestrator.scene.conditions import COMPARISONS
from hapticlink.orchestrator.system import held_polynomials

Bound = list[tuple[Instruction, Call]]


class Stop(Exception):
    """Raised when the scene's stop condition holds."""


class Binder:
    """Binds operations to the FMUs, holds and signals of a simulation.

    loops: the fixed-point iterations that were bound, whose counts the run reports. joined: makes
    one call of a sequence of instructions and their calls; without it each is a call.
    """

    def __init__(
        self,
        simulation: Simulation,
        joined: Callable[[Bound], Call] | None = None,
    ) -> None:
        self._simulation, self._joined = simulation, joined
        self._calls: dict[Instruction, Call] = {}
        self.loops: dict[Repeat, FixedPoint] = {}

    def instructions(self, operations: Iterable[Operation], judged: bool = True) -> Bound:
        """The instructions of a block with their calls. Not `judged`, outputs need not be
        finite."""
        found = []
        for each in instructions(operations, self._simulation, judged):
            if (call := self._calls.get(each)) is None:  # kinds of events share most of theirs
                call = self._calls[each] = self.bind(each)
            found.append((each, call))
        return found

    def bind_all(self, operations: Iterable[Operation], judged: bool = True) -> list[Call]:
        bound = self.instructions(operations, judged)
        return [self._joined(bound)] if self._joined else [call for _, call in bound]

    def bind(self, operation: Instruction) -> Call:
        """The call that executes an operation; its argument is the tick."""
        simulation = self._simulation
        match operation:
            case Get(fmu, judged=judged):
                instance = simulation.instances[fmu]
                get = instance.get if judged else instance.read
                return lambda tick: get()
            case Sample(connection, ahead):
                sample = simulation.meters.of[connection].sample
                return lambda tick: sample(tick + ahead)
            case Move(connection, ahead):
                move = simulation.meters.of[connection].move
                return lambda tick: move(tick + ahead)
            case Feed(connection, share):
                hold = simulation.meters.of[connection].hold
                return lambda tick: hold(share)
            case Finish(fmus):
                return self._finish(fmus)
            case Collect(clock):
                return lambda tick: simulation.collect(clock, tick)
            case Set(fmu, now, derivatives):
                return self._set(fmu, now, derivatives)
            case Step(fmu, dticks, part, parts):
                return self._live(fmu, self._step(fmu, dticks, part, parts))
            case Push(connection, ahead):
                return self._push(connection, ahead)
            case Evaluate(connection, instant, 0):
                return self._evaluate(connection, float(instant))
            case Evaluate(connection, instant, order, width):
                return self._derive(connection, float(instant), order, float(width))
            case Blend(connection, points):
                return self._blend(connection, points)
            case Save(fmu):
                save = simulation.instances[fmu].save
                return lambda tick: save()
            case Rollback(fmu):
                rollback = simulation.instances[fmu].rollback
                return lambda tick: rollback()
            case Repeat():
                return self._repeat(operation)
            case Record(clock):
                row, seconds = simulation.recorders[clock].row, simulation.seconds
                return lambda tick: row(seconds(tick))
            case StopWhen():
                return self._stop_when()

    def _finish(self, fmus: Iterable[str]) -> Call:
        instances = [self._simulation.instances[fmu] for fmu in fmus]

        def finish(tick: int) -> None:
            for instance in instances:
                instance.finish()

        return finish

    def _set(self, fmu: str, now: bool, derivatives: bool) -> Call:
        simulation, values = self._simulation, self._simulation.signals.values
        set_from = (simulation.now_setters if now else simulation.setters)[fmu]
        if not derivatives:
            return lambda tick: set_from(values)
        derive = simulation.derivative_setters[fmu]

        def set_both(tick: int) -> None:
            set_from(values)
            derive(values)

        return set_both

    def _step(self, fmu: str, dticks: int, part: int, parts: int) -> Call:
        """doStep over `dticks`, or over substep `part` of `parts`; outputs are stamped at its end,
        those of a sampled block at its start."""
        simulation = self._simulation
        step, seconds = simulation.instances[fmu].step, simulation.seconds
        size, check = seconds(dticks), simulation.step_checks.get(fmu)
        if fmu in simulation.beside:  # what a check reads is the loop's
            check = None
        valid = 0 if simulation.system.fmu[fmu].sampled else dticks
        if parts > 1:
            base = simulation.system.timeline.base / parts
            begin, size = part * dticks, float(dticks * base)

            def substep(tick: int) -> None:
                start = tick * parts + begin
                step(float(start * base), float((start + dticks) * base), size)

            return substep
        if check:

            def checked(tick: int) -> None:
                time, end = seconds(tick), seconds(tick + dticks)
                check.around(lambda: step(time, end, size), time, end)

            return checked
        return lambda tick: step(seconds(tick), seconds(tick + valid), size)

    def _live(self, fmu: str, step: Call) -> Call:
        """An FMU takes settings that wait for it before its step; beside the loop, in real time,
        the step is begun only."""
        simulation, instance = self._simulation, self._simulation.instances[fmu]
        if not simulation.pace and instance.place.waiting == math.inf:
            return step
        place, seconds = instance.place, simulation.seconds
        side = simulation.sides[simulation.beside[fmu]] if fmu in simulation.beside else None

        def live(tick: int) -> None:
            if place.waiting <= (time := seconds(tick)):
                instance.settle(time)
            if side:
                side.start(instance, lambda: step(tick))
            else:
                step(tick)

        return live

    def _push(self, connection: str, ahead: int) -> Call:
        """Pushes the source's sample into the hold; it arrives at the tick of the event. Sources
        that are adjacent in the signal vector are passed as a view, without a copy."""
        simulation = self._simulation
        hold, values = simulation.holds[connection], simulation.signals.values
        sources = simulation.signals.sources(simulation.system.connection[connection])
        view = simulation.signals.view(sources)
        if view is not None:
            return lambda tick: hold.push(tick + ahead, view, tick + simulation.late)
        return lambda tick: hold.push(tick + ahead, values[sources], tick + simulation.late)

    def _held(self, connection: str) -> tuple[Hold, Vector]:
        """The hold of a connection, and where its value stands among the signals."""
        signals = self._simulation.signals
        return self._simulation.holds[connection], signals.values[signals.hold(connection)]

    def _evaluate(self, connection: str, ahead: float) -> Call:
        """Writes the hold's value `ahead` ticks after the event to the target's held input."""
        simulation, (hold, view) = self._simulation, self._held(connection)

        def evaluate(tick: int) -> None:
            late = simulation.late
            view[:] = hold.value(tick + late, ahead - late)

        return evaluate

    def _derive(self, connection: str, ahead: float, order: int, width: float) -> Call:
        """Writes the hold's value at the beginning of a step of `width` ticks, the derivatives
        there up to `order`, and the mean over the step, from the polynomial through order + 1
        equidistant values."""
        simulation, (hold, view) = self._simulation, self._held(connection)
        values, span = simulation.signals.values, simulation.signals.derivatives(connection)
        derived, mean = values[span], values[span.stop : span.stop + len(view)]
        instants = [ahead + i * width / order for i in range(order + 1)]
        seconds = simulation.seconds(width)

        def derive(tick: int) -> None:
            late = simulation.late
            samples = np.stack([hold.value(tick + late, instant - late) for instant in instants])
            view[:] = samples[0]
            derivatives, mean[:] = held_polynomials.split(samples, seconds)
            derived[:] = derivatives.ravel()

        return derive

    def _blend(self, connection: str, points: tuple[tuple[float, Fraction], ...]) -> Call:
        """Writes a weighted sum of the hold's values at several instants."""
        simulation, (hold, view) = self._simulation, self._held(connection)
        pairs = [(weight, float(ahead)) for weight, ahead in points]

        def blend(tick: int) -> None:
            late = simulation.late
            view[:] = sum(w * hold.value(tick + late, ahead - late) for w, ahead in pairs)

        return blend

    def _repeat(self, operation: Repeat) -> FixedPoint:
        """The fixed-point iteration of a Repeat, shared by all events, with its solver's state."""
        if operation in self.loops:
            return self.loops[operation]

        body = self.bind_all(operation.body, judged=False)  # iterations can have non-finite outputs
        calls = (self.bind_all(operation.guess), body, self.bind_all(operation.again))
        held = [self.bind(op) for op in operation.body if isinstance(op, Blend)]
        loop = FixedPoint(operation, self._simulation, calls, held)
        self.loops[operation] = loop
        return loop

    def _stop_when(self) -> Call:
        simulation = self._simulation
        condition = simulation.system.ends_when
        assert condition is not None
        place = simulation.signals.scalar(condition.fmu, condition.variable)
        holds, values = COMPARISONS[condition.comparison], simulation.signals.values
        limit = condition.value

        def stop_when(tick: int) -> None:
            if holds(values[place], limit):
                raise Stop

        return stop_when
