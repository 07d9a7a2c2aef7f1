"""The event loop in Python, and the instructions that it carries out: all of them where there is no
compiled loop, and otherwise those that have no C. It is the reference of the compiled loop."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.holds import Hold
from hapticlink.orchestrator.plan.operations import (
    Blend,
    Evaluate,
    Event,
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
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.results.run_record import Iterations
from hapticlink.orchestrator.run.fixed_point import FixedPoint, total
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


class Stop(Exception):
    """Raised when the scene's stop condition holds."""


class OperationsInPython:
    """Carries out the instructions of a simulation.

    loops: the fixed-point iterations so far, whose counts the run reports. joined: makes one call
    of a sequence of instructions; by default they are carried out one after the other.
    """

    def __init__(
        self,
        simulation: Simulation,
        joined: Callable[[Sequence[Instruction]], Call] | None = None,
    ) -> None:
        self.simulation, self._joined = simulation, joined or self._one_after_the_other
        connections, sources = simulation.system.connections, simulation.signals.sources
        self._sources = {c.name: sources(c) for c in connections if c.hold}
        self.loops: dict[Repeat, FixedPoint] = {}
        self._loop_of: dict[int, FixedPoint] = {}  # a Repeat's hash takes as long as a step

    def __call__(self, instruction: Instruction, tick: int) -> None:
        simulation = self.simulation
        instances, meters = simulation.instances, simulation.meters.of
        values, late = simulation.signals.values, simulation.late
        match instruction:
            case Get(fmu, judged=True):
                instances[fmu].get()
            case Get(fmu):
                instances[fmu].read()
            case Set(fmu, now):
                simulation.setters[fmu, now](values)
            case Step(fmu):
                self._step(instruction, tick)
            case Push(connection, ahead):
                sample = values[self._sources[connection]]
                simulation.holds[connection].push(tick + ahead, sample, tick + late)
            case Evaluate(connection, ahead):
                hold, held = self._held(connection)
                held[:] = hold.value(tick + late, float(ahead) - late)
            case Blend(connection, points):
                hold, held = self._held(connection)
                held[:] = sum(w * hold.value(tick + late, float(at) - late) for w, at in points)
            case Sample(connection, ahead):
                meters[connection].sample(tick + ahead)
            case Move(connection, ahead):
                meters[connection].move(tick + ahead)
            case Feed(connection, share):
                meters[connection].hold(share)
            case Record(clock):
                simulation.recorders[clock].row(simulation.seconds(tick))
            case StopWhen():
                condition = simulation.system.ends_when
                assert condition is not None
                value = values[simulation.signals.scalar(condition.fmu, condition.variable)]
                if COMPARISONS[condition.comparison](value, condition.value):
                    raise Stop
            case Save(fmu):
                instances[fmu].save()
            case Rollback(fmu):
                instances[fmu].rollback()
            case Repeat():
                if (loop := self._loop_of.get(id(instruction))) is None:
                    loop = self._loop_of[id(instruction)] = self._loop(instruction)
                loop(tick)
            case Finish(fmus):
                for fmu in fmus:
                    instances[fmu].finish()
            case Collect(clock):
                simulation.collect(clock, tick)

    def _loop(self, repeat: Repeat) -> FixedPoint:
        """The iteration of a Repeat, which all events share with its solver's state."""
        if repeat not in self.loops:
            self.loops[repeat] = FixedPoint(repeat, self.simulation, self._sequence)
        return self.loops[repeat]

    def _sequence(self, operations: Iterable[Operation]) -> Call:
        return self._joined([*instructions(operations, self.simulation)])

    def _one_after_the_other(self, sequence: Sequence[Instruction]) -> Call:
        def call(tick: int) -> None:
            for instruction in sequence:
                self(instruction, tick)

        return call

    def _step(self, step: Step, tick: int) -> None:
        """doStep over `dticks`, or over substep `part` of `parts`; outputs are stamped at its end,
        those of a sampled block at its start. Settings that wait for the FMU come before; beside
        the loop, in real time, the step is begun only."""
        simulation, parts = self.simulation, step.parts
        instance, base = simulation.instances[step.fmu], simulation.system.timeline.base

        def seconds(ticks: int) -> float:
            return ticks * base.numerator / (base.denominator * parts)

        if instance.place.waiting <= (now := simulation.seconds(tick)):
            instance.settle(now)
        begin = tick * parts + step.part * step.dticks
        sampled = simulation.system.fmu[step.fmu].sampled and parts == 1
        end = begin if sampled else begin + step.dticks
        times = seconds(begin), seconds(end), seconds(step.dticks)
        check = simulation.step_checks.get(step.fmu) if parts == 1 else None
        if clock := simulation.beside.get(step.fmu):  # what a check reads is the loop's
            simulation.sides[clock].start(instance, lambda: instance.step(*times))
        elif check:
            check.around(lambda: instance.step(*times), *times[:2])
        else:
            instance.step(*times)

    def _held(self, connection: str) -> tuple[Hold, Vector]:
        """The hold of a connection, and where its value stands among the signals."""
        signals = self.simulation.signals
        return self.simulation.holds[connection], signals.values[signals.hold(connection)]


class PythonLoop:
    """The loop of a plan. complete: number of events that are complete. in_python: what is carried
    out in Python, with the reason."""

    def __init__(
        self, plan: Plan, operations: OperationsInPython, in_python: dict[str, str]
    ) -> None:
        self._plan, self._operations, self.in_python = plan, operations, in_python
        self.complete = 0

    def run(self, turn: Callable[[int], object]) -> None:
        """Run all events; `turn` is called after each with its tick."""
        known: dict[Event, list[Instruction]] = {}
        for tick, event in self._plan:
            if event not in known:
                known[event] = self._instructions(event)
            for instruction in known[event]:
                self._operations(instruction, tick)
            self.complete += 1
            turn(tick)

    def _instructions(self, kind: Event) -> list[Instruction]:
        return [*instructions(self._plan.block(kind), self._operations.simulation)]

    def iterations(self) -> Iterations | None:
        return total(loop.counts for loop in self._operations.loops.values())
