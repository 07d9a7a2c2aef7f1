"""Gauss-Seidel: sampled blocks run one after the other before the plants step.

At t: read the plants whose steps end at t; each sampled block, in the order of its inputs,
takes what is known at t and puts out y(t); then the plants start their steps with it. No
connection is delayed. In a ring of sampled blocks an input that no output depends on directly
(ModelStructure, FMI 2.0.5 section 2.2.8) makes no order: it takes its source's output of the
period before. A ring of direct dependencies has no order at all.
"""

from __future__ import annotations

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.plan import building_blocks, dependency_order
from hapticlink.orchestrator.plan.operations import Event, Operation
from hapticlink.orchestrator.system.system import Fmu, System


def block(system: System, event: Event) -> tuple[Operation, ...]:
    """The operations of `event`. Raises InputFault naming a ring of sampled blocks."""
    sampled, continuous = building_blocks.firing(system, event)
    operations: list[Operation] = [*building_blocks.publish_ended(system, event, continuous)]
    for fmu in in_order(system, sampled):
        operations += building_blocks.feed(system, event, fmu)
        operations += building_blocks.step(system, event, fmu)
        operations += building_blocks.publish(system, fmu)
    operations += building_blocks.record(system, event)
    for fmu in building_blocks.starting(event, continuous):
        operations += building_blocks.feed(system, event, fmu)
        operations += building_blocks.step(system, event, fmu)
    return tuple(operations)


def ordered(system: System) -> list[list[Fmu]]:
    """The sampled blocks."""
    return [[u for u in system.fmus if u.sampled]]


def in_order(system: System, fmus: list[Fmu]) -> list[Fmu]:
    """`fmus` so that each comes after those that feed it."""
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
