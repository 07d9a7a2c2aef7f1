"""Gauss-Seidel among the plants: each uses the outputs at the end of the step of those before it.

As Gauss-Seidel up to the plants. Then these step one after the other, each after those that feed
it; within a loop they are ordered by direct feed-through, then as declared. Each is read at once,
and its outputs, stamped with the end of the step, are pushed to those that come after it, whose
holds then interpolate instead of extrapolating. The scheme is not causal; it is meant for
comparison with the literature on continuous coupling.
"""

from __future__ import annotations

from hapticlink.orchestrator.plan import dependency_order, operation_sequences
from hapticlink.orchestrator.plan.operations import Event, Operation
from hapticlink.orchestrator.plan.schemes import gauss_seidel
from hapticlink.orchestrator.system.system import Fmu, System


def block(system: System, event: Event) -> tuple[Operation, ...]:
    """The operations of `event`. Raises InputFault for a feed-through loop of sampled blocks."""
    operations = gauss_seidel.before_plants(system, event)
    starting = operation_sequences.starting(
        system, event, operation_sequences.firing(system, event)[1]
    )
    for unit in (u for group in dependency_order.plants(system, starting) for u in group):
        operations += operation_sequences.feed(system, event, unit)
        operations += operation_sequences.step(system, event, unit)
        operations += operation_sequences.publish(
            system, unit, operation_sequences.dticks(event, unit)
        )
    return tuple(operations)


def order_fmus(system: System) -> list[list[Fmu]]:
    return [*gauss_seidel.order_fmus(system), [u for u in system.fmus if not u.sampled]]
