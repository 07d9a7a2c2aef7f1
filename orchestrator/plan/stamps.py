"""Traces stamps through a plan without running FMUs: the sample that each input depends on."""

from __future__ import annotations

from collections.abc import Container, Iterator
from typing import NamedTuple

from hapticlink.orchestrator.plan.operations import (
    Blend,
    Evaluate,
    Event,
    Get,
    Operation,
    Push,
    Set,
)
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.system.latency_and_loss import SampleLink


class Use(NamedTuple):
    """At `tick` the target of `connection` got a value computed from samples up to `stamp`."""

    tick: int
    connection: str
    stamp: int


def uses(
    plan: Plan, until: int | None = None, connections: Container[str] | None = None
) -> Iterator[Use]:
    """Every value given to every input over the whole run, or up to a tick, in order; of these
    connections alone if they are given."""
    system = plan.system
    traced = [c for c in system.connections if connections is None or c.name in connections]
    source = {c.name: c.source for c in traced}
    into = {u.name: [c for c in system.into(u.name) if c.name in source] for u in system.fmus}
    got, pushed = dict.fromkeys(system.fmu, 0), dict.fromkeys(source, 0)
    held = dict.fromkeys(source, 0)
    late = ((c.name, c.latency) for c in traced if c.hold)
    links = {name: SampleLink(latency, system.timeline.base) for name, latency in late if latency}
    blocks: dict[Event, list[Operation]] = {}

    def concerned(operation: Operation) -> bool:
        match operation:
            case Push(name) | Evaluate(name) | Blend(name):
                return name in source
            case Set(fmu):
                return bool(into[fmu])
        return isinstance(operation, Get)

    for tick, event in plan:
        if until is not None and tick > until:
            return
        if event not in blocks:
            blocks[event] = [*filter(concerned, plan.unrolled(event))]
        for operation in blocks[event]:
            match operation:
                case Get(fmu, ahead):
                    got[fmu] = tick + ahead
                case Push(name, ahead):
                    stamp = tick + ahead if ahead else got[source[name]]
                    if name in links:
                        links[name].send(stamp)
                    else:
                        pushed[name] = stamp
                case Evaluate(name) | Blend(name):
                    for _, stamp, _ in links[name].arrived(tick) if name in links else ():
                        pushed[name] = stamp
                    held[name] = pushed[name]
                case Set(fmu, now):
                    for c in into[fmu]:
                        stamp = held[c.name] if c.hold and not now else got[c.source]
                        yield Use(tick, c.name, stamp)
