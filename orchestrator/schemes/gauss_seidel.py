"""Gauss-Seidel: sampled blocks run one after the other before the plants step.

At t: read the plants whose steps end at t; each sampled block, in the order of its inputs,
takes what is known at t and puts out y(t); then the plants start their steps with it. No
connection is delayed. Sampled blocks in a ring have no such order.
"""

from __future__ import annotations

from hapticlink.orchestrator.faults import InputFault
from hapticlink.orchestrator.schemes import phrases
from hapticlink.orchestrator.schemes.operations import Event, Operation
from hapticlink.orchestrator.system import System, Unit


def block(system: System, event: Event) -> tuple[Operation, ...]:
    """The operations of `event`. Raises InputFault naming a ring of sampled blocks."""
    sampled, continuous = phrases.firing(system, event)
    operations: list[Operation] = [*phrases.publish_ended(system, event, continuous)]
    for unit in in_order(system, sampled):
        operations += phrases.feed(system, unit)
        operations.append(phrases.step(event, unit))
        operations += phrases.publish(system, unit)
    operations += phrases.record(system, event)
    for unit in phrases.starting(event, continuous):
        operations += phrases.feed(system, unit)
        operations.append(phrases.step(event, unit))
    return tuple(operations)


def in_order(system: System, units: list[Unit]) -> list[Unit]:
    """`units` so that each comes after those that feed it."""
    waiting = {u.name: {c.source for c in system.into(u.name)} for u in units}
    ordered: list[Unit] = []
    while waiting:
        ready = [name for name, sources in waiting.items() if not sources & waiting.keys()]
        if not ready:
            raise InputFault(
                f"sampled blocks feed each other in a ring: {_ring(waiting)}; take "
                "coupling = 'jacobi', which puts a delay of one period into it"
            )
        ordered += [system.unit[name] for name in ready]
        for name in ready:
            del waiting[name]
    return ordered


def _ring(waiting: dict[str, set[str]]) -> str:
    """A ring as `a -> b -> a`, walked from target to source."""
    path = [next(iter(waiting))]
    while True:
        source = sorted(waiting[path[-1]] & waiting.keys())[0]
        if source in path:
            ring = [source, *reversed(path[path.index(source) :])]
            return " -> ".join(ring)
        path.append(source)
