"""The instructions of a run: the operations of its plan, with what its energy meters take of these
and where FMUs that step concurrently are waited for, which are declared as operations are.

Consecutive doSteps of FMUs in processes of their own run concurrently; any other operation is a
barrier. Steps are started and awaited in the plan's order, so results and faults are those of
sequential execution.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass

from hapticlink.orchestrator.plan.operations import Get, Instruction, Operation, Set, Step
from hapticlink.orchestrator.run.simulation import Simulation


@dataclass(frozen=True)
class OfMeter(Instruction):
    """An operation of the energy meter of a connection."""

    connection: str
    observes = True


@dataclass(frozen=True)
class Sample(OfMeter):
    """The meter of a connection takes a sample of its source, stamped `ahead` of the tick."""

    ahead: int
    code, b = "SAMPLE", "ahead"


@dataclass(frozen=True)
class Move(OfMeter):
    """The meter of a connection takes the displacement of its target, `ahead` of the tick."""

    ahead: int
    code, b = "MOVE", "ahead"


@dataclass(frozen=True)
class Feed(OfMeter):
    """The meter of a connection takes the effort that its target holds over a `share` of a step."""

    share: float
    code, x = "FEED", "share"
    concurrent = True


@dataclass(frozen=True)
class Collect(Instruction):
    """Take over what the steps beside the loop of a clock's FMUs have left."""

    clock: str
    why_in_python = "its FMUs run beside the loop, in a thread"


@dataclass(frozen=True)
class Finish(Instruction):
    """Wait until the steps of FMUs in processes of their own have been taken."""

    fmus: tuple[str, ...]
    why_in_python = "the FMU runs in a process of its own"


def instructions(operations: Iterable[Operation], simulation: Simulation) -> Iterator[Instruction]:
    """The instructions of a block."""
    waited = {fmu for fmu in simulation.isolated if fmu not in simulation.beside}
    return _with_barriers(_with_meters(operations, simulation), waited)


def _with_meters(operations: Iterable[Operation], simulation: Simulation) -> Iterator[Instruction]:
    """The operations, each followed by what the meters take of it, with a Collect before the first
    outputs of a clock whose FMUs step beside the loop."""
    meters, collected = simulation.meters, set[str]()
    for operation in operations:
        match operation:
            case Get(fmu, ahead) if ahead and fmu in simulation.system.early:
                yield operation  # meters take it when the step has ended
            case Get(fmu, ahead):
                clock = simulation.beside.get(fmu)
                if clock and clock not in collected:
                    collected.add(clock)
                    yield Collect(clock)
                yield operation
                yield from (Sample(c, ahead) for c in meters.of_source.get(fmu, ()))
                yield from (Move(c, ahead) for c in meters.of_target.get(fmu, ()))
            case Set(fmu, now=False):
                yield operation
                share = 1.0 / simulation.system.coupling.substeps.get(fmu, 1)
                yield from (Feed(c, share) for c in meters.of_target.get(fmu, ()))
            case _:
                yield operation


def _with_barriers(
    instructions: Iterable[Instruction], isolated: Container[str]
) -> Iterator[Instruction]:
    """The instructions, with a barrier after each group of concurrent steps."""
    stepping: list[str] = []
    for instruction in instructions:
        own = isinstance(instruction, Set | Step) and instruction.fmu
        if stepping and not (instruction.concurrent or (own in isolated and own not in stepping)):
            yield Finish(tuple(stepping))
            stepping.clear()
        yield instruction
        if isinstance(instruction, Step) and instruction.fmu in isolated:
            stepping.append(instruction.fmu)
    if stepping:
        yield Finish(tuple(stepping))
