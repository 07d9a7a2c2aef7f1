"""Gauss-Seidel among the plants: each takes the end of the step of those before it.

As Gauss-Seidel up to the plants. Then these step one after the other, each after those that feed
it; a loop has no such order, and goes by direct dependencies, then by the order of the system.
Each is read at once, and its outputs, stamped with the end of the step, are given to those that
come after it. Their holds interpolate where they would extrapolate. It reads the future, so it
claims no causality: for comparison with the literature on continuous coupling.
"""

from __future__ import annotations

from hapticlink.orchestrator.schemes import gauss_seidel, order, phrases
from hapticlink.orchestrator.schemes.operations import Event, Operation
from hapticlink.orchestrator.system import System


def block(system: System, event: Event) -> tuple[Operation, ...]:
    """The operations of `event`. Raises InputFault naming a ring of sampled blocks."""
    operations = [*gauss_seidel.block(system, phrases.without_steps(event))]
    starting = phrases.starting(event, phrases.firing(system, event)[1])
    for unit in (u for group in order.plants(system, starting) for u in group):
        operations += phrases.feed(system, event, unit)
        operations += phrases.step(system, event, unit)
        operations += phrases.publish(system, unit, phrases.dticks(event, unit))
    return tuple(operations)
