"""The operations that the compiled loop leaves to Python: those of FMUs that it does not call
itself (in other processes, in event mode, beside the loop), repeated steps, and what is rare."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from hapticlink.orchestrator.plan.operations import (
    Get,
    Instruction,
    Operation,
    Record,
    Repeat,
    Rollback,
    Save,
    Set,
    Step,
)
from hapticlink.orchestrator.run.fixed_point import FixedPoint
from hapticlink.orchestrator.run.instructions import Collect, Finish, instructions
from hapticlink.orchestrator.run.simulation import Call, Simulation


class OperationsInPython:
    """Carries out instructions of a simulation.

    joined: makes one call of a sequence of instructions, which the loop carries out. loops: the
    fixed-point iterations so far, whose counts the run reports.
    """

    def __init__(
        self, simulation: Simulation, joined: Callable[[Sequence[Instruction]], Call]
    ) -> None:
        self._simulation, self._joined = simulation, joined
        self.loops: dict[Repeat, FixedPoint] = {}
        self._loop_of: dict[int, FixedPoint] = {}  # a Repeat's hash takes as long as a step
        self._remembered: dict[str, dict[str, Any]] = {}

    def saved(self) -> dict[str, dict[str, Any]]:
        """What the fixed-point iterations keep from step to step, by their operation as text."""
        return self._remembered | {repr(of): loop.saved() for of, loop in self.loops.items()}

    def restore(self, saved: dict[str, dict[str, Any]]) -> None:
        """Let the iterations, each from its first step on, go on from what they kept."""
        self._remembered = saved

    def __call__(self, instruction: Instruction, tick: int) -> None:
        simulation = self._simulation
        instances, values = simulation.instances, simulation.signals.values
        match instruction:
            case Get(fmu, judged=True):
                instances[fmu].get()
            case Get(fmu):
                instances[fmu].read()
            case Set(fmu, now):
                simulation.setters[fmu, now](values)
            case Step(fmu):
                self._step(instruction, tick)
            case Record(table):
                simulation.recorders[table].row(simulation.time(tick))
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
            case _:
                raise AssertionError(instruction)

    def _loop(self, repeat: Repeat) -> FixedPoint:
        """The iteration of a Repeat, which all events share with its solver's state."""
        if repeat not in self.loops:
            made = FixedPoint(repeat, self._simulation, self._sequence)
            if kept := self._remembered.pop(repr(repeat), None):
                made.restore(kept)
            self.loops[repeat] = made
        return self.loops[repeat]

    def _sequence(self, operations: Iterable[Operation]) -> Call:
        return self._joined([*instructions(operations, self._simulation)])

    def _step(self, step: Step, tick: int) -> None:
        """doStep over `dticks`, or over substep `part` of `parts`; outputs are stamped at its end,
        those of a sampled block at its start. Settings that wait for the FMU come before; beside
        the loop, in real time, the step is begun only."""
        simulation, parts = self._simulation, step.parts
        instance, timeline = simulation.instances[step.fmu], simulation.system.timeline
        if instance.place.waiting <= (now := timeline.time(tick)):
            instance.settle(now)
        begin = tick * parts + step.part * step.dticks
        sampled = simulation.system.fmu[step.fmu].sampled and parts == 1
        end = begin if sampled else begin + step.dticks
        size = float(step.dticks * timeline.base / parts)
        times = timeline.time(begin, parts), timeline.time(end, parts), size
        check = simulation.step_checks.get(step.fmu) if parts == 1 else None
        if clock := simulation.beside.get(step.fmu):  # what a check reads is the loop's
            simulation.sides[clock].start(instance, lambda: instance.step(*times))
        elif check:
            check.around(lambda: instance.step(*times), *times[:2])
        else:
            instance.step(*times)
