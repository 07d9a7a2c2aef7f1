"""Gauss-Seidel among the plants: each takes the end of the step of those before it.

As Gauss-Seidel up to the plants. Then these step one after the other, in the order of the
system; each is read at once, and its outputs, stamped with the end of the step, are given to
those that come after it. Their holds interpolate where they would extrapolate. It reads the
future, so it claims no causality: for comparison with the literature on continuous coupling.
"""

from __future__ import annotations

from hapticlink.orchestrator.schemes import gauss_seidel, phrases
from hapticlink.orchestrator.schemes.operations import Event, Operation, Step
from hapticlink.orchestrator.system import System


def block(system: System, event: Event) -> tuple[Operation, ...]:
    """The operations of `event`. Raises InputFault naming a ring of sampled blocks."""
    _, continuous = phrases.firing(system, event)
    started = {u.name for u in phrases.starting(event, continuous)}
    causal = gauss_seidel.block(system, event)
    ends = {op.fmu: op for op in causal if isinstance(op, Step) and op.fmu in started}.values()
    operations: list[Operation] = []
    for operation in causal:
        operations.append(operation)
        if isinstance(operation, Step) and operation in ends:
            unit = system.unit[operation.fmu]
            operations += phrases.publish(system, unit, phrases.dticks(event, unit))
    return tuple(operations)
