"""Jacobi, as FMI allows it: get all, set all, step all.

Everybody takes what was read before anybody is set, so what a sampled block puts out at t
reaches the others one event later. Sampled outputs are read and recorded with their own
stamp t.
"""

from __future__ import annotations

from hapticlink.orchestrator.schemes import phrases
from hapticlink.orchestrator.schemes.operations import Event, Operation
from hapticlink.orchestrator.system import System


def block(system: System, event: Event) -> tuple[Operation, ...]:
    """The operations of `event`."""
    sampled, continuous = phrases.firing(system, event)
    started = phrases.starting(event, continuous)
    operations: list[Operation] = [*phrases.publish_ended(system, event, continuous)]
    for unit in [*sampled, *started]:
        operations += phrases.feed(system, event, unit)
    for unit in sampled:
        operations += phrases.step(system, event, unit)
    for unit in sampled:
        operations += phrases.publish(system, unit)
    operations += phrases.record(system, event)
    for unit in started:
        operations += phrases.step(system, event, unit)
    return tuple(operations)
