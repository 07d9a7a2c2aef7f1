"""Gauss-Seidel: sampled blocks run one after the other before the plants step.

At t: read the plants whose steps end at t; each sampled block, after those that feed it, computes
y(t) from its inputs at t; then the plants start their steps with these outputs. No connection adds
a delay. In a loop of sampled blocks, an input without direct feed-through (ModelStructure,
FMI 2.0.5 section 2.2.8) is ignored for the order: it gets its source's output of the previous
period. A loop by direct feed-through alone is an error.
"""

from __future__ import annotations

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.plan import dependency_order, operation_sequences
from hapticlink.orchestrator.plan.operations import Event, Operation
from hapticlink.orchestrator.system.system import Fmu, System


def block(system: System, event: Event) -> tuple[Operation, ...]:
    """The operations of `event`. Raises InputFault for a feed-through loop of sampled blocks."""
    operations = before_plants(system, event)
    continuous = operation_sequences.firing(system, event)[1]
    starting = operation_sequences.starting(system, event, continuous)
    slow, others = operation_sequences.early_first(system, starting)
    for fmu in slow:
        operations += operation_sequences.feed(system, event, fmu)
        operations += operation_sequences.step(system, event, fmu)
    for fmu in (u for u in slow if u.name in system.early):
        operations += operation_sequences.publish_early(system, event, fmu)
    for fmu in others:
        operations += operation_sequences.feed(system, event, fmu)
        operations += operation_sequences.step(system, event, fmu)
    return tuple(operations)


def before_plants(system: System, event: Event) -> list[Operation]:
    """The operations of `event` up to the steps of the plants."""
    sampled, continuous = operation_sequences.firing(system, event)
    operations: list[Operation] = [*operation_sequences.publish_ended(system, event, continuous)]
    for fmu in in_order(system, sampled):
        operations += operation_sequences.feed(system, event, fmu)
        operations += operation_sequences.step(system, event, fmu)
        operations += operation_sequences.publish(system, fmu)
    operations += operation_sequences.record(system, event)
    return operations


def order_fmus(system: System) -> list[list[Fmu]]:
    return [[u for u in system.fmus if u.sampled]]


def in_order(system: System, fmus: list[Fmu]) -> list[Fmu]:
    """`fmus` in an order in which each comes after those that feed it."""
    ordered: list[Fmu] = []
    for group in dependency_order.groups(system, fmus):
        inside = dependency_order.direct(system, group)
        for part in dependency_order.components(inside):
            if len(part) > 1 or part[0] in inside[part[0]]:
                ring = dependency_order.ring(inside, part)
                raise InputFault(
                    f"sampled blocks feed each other in a ring: {ring}; take "
                    "coupling = 'jacobi', which puts a delay of one period into it"
                )
            ordered.append(system.fmu[part[0]])
    return ordered
