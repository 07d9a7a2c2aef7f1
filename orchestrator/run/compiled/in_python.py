"""Which operations have no C, and why, for run.json."""

from __future__ import annotations

from hapticlink.orchestrator.plan.operations import Blend, Evaluate, Get, Push, Set, Step
from hapticlink.orchestrator.run.bind_operations import Instruction
from hapticlink.orchestrator.run.compiled.holds import parts
from hapticlink.orchestrator.run.concurrent_fmus import Collect
from hapticlink.orchestrator.run.metered_operations import Read
from hapticlink.orchestrator.run.parallel_steps import Finish
from hapticlink.orchestrator.run.simulation import Simulation


def why(instruction: Instruction, simulation: Simulation) -> str:
    """Why an operation is carried out in Python."""
    match instruction:
        case Evaluate(_, _, order) if order:
            return "the FMU takes derivatives of its inputs"
        case Set(_, _, True):
            return "the FMU takes derivatives of its inputs"
        case Step(fmu) if fmu in simulation.beside:
            return "the FMU runs beside the loop, in a thread"
        case Collect():
            return "its FMUs run beside the loop, in a thread"
        case Push(connection) | Evaluate(connection) | Blend(connection):
            kind = type(parts(simulation.holds[connection]).own).__name__
            return f"there is no C for {kind}, or none that takes samples back"
        case Get(fmu) | Read(fmu) | Set(fmu) | Step(fmu) if fmu in simulation.isolated:
            return "the FMU runs in a process of its own"
        case Finish():
            return "the FMU runs in a process of its own"
    return "Python repeats steps, whose operations are in C"


def named(instruction: Instruction) -> str:
    """The name of an operation with that of its FMU or connection."""
    first = next(iter(vars(instruction).values()), "")
    return f"{type(instruction).__name__.lower()} {first if isinstance(first, str) else ''}".strip()
