"""Jacobi in conformity with FMI: get all, set all, step all.

All FMUs use outputs that were read before any input is set, so that an output of a sampled block at
t reaches the others one event later. Sampled outputs are read and recorded with their own stamp t.
"""

from __future__ import annotations

from hapticlink.orchestrator.plan import operation_sequences
from hapticlink.orchestrator.plan.operations import Event, Operation
from hapticlink.orchestrator.system.system import System


def block(system: System, event: Event) -> tuple[Operation, ...]:
    sampled, continuous = operation_sequences.firing(system, event)
    started = operation_sequences.starting(system, event, continuous)
    operations: list[Operation] = [*operation_sequences.publish_ended(system, event, continuous)]
    for unit in [*sampled, *started]:
        operations += operation_sequences.feed(system, event, unit)
    for unit in sampled:
        operations += operation_sequences.step(system, event, unit)
    divided = [unit for unit in started if unit.name in system.coupling.substeps]
    for unit in divided:  # all its substeps take what the first one does
        operations += operation_sequences.step(system, event, unit)
    for unit in sampled:
        operations += operation_sequences.publish(system, unit)
    operations += operation_sequences.record(system, event)
    for unit in started:
        if unit not in divided:
            operations += operation_sequences.step(system, event, unit)
    for unit in (u for u in started if u.name in system.early):
        operations += operation_sequences.publish_early(system, event, unit)
    return tuple(operations)
