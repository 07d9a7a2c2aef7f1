"""Traces stamps through a plan without running FMUs: the sample that each input depends on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
from hapticlink.orchestrator.system.latency_and_loss import Link


class Use(NamedTuple):
    """At `tick` the target of `connection` got a value computed from samples up to `stamp`."""

    tick: int
    connection: str
    stamp: int


Take = Callable[[int, str, int], object]
"""A function that is called for each Use."""


class Stamps:
    """The stamps of all samples as events of a plan are processed; `take` is called for each use.
    The operations of each kind of event are bound once."""

    def __init__(self, plan: Plan, take: Take) -> None:
        system = plan.system
        self._plan, self._take = plan, take
        self._connections = {c.name: c for c in system.connections}
        self._incoming = {u.name: system.into(u.name) for u in system.fmus}
        self._got = dict.fromkeys(system.fmu, 0)
        self._pushed = dict.fromkeys(self._connections, 0)
        self._held = dict.fromkeys(self._connections, 0)
        base = system.timeline.base
        held = (c for c in system.connections if c.hold and c.latency)
        self._links = {c.name: Link(c.latency, base) for c in held if c.latency}
        self._bound: dict[Event, list[Callable[[int], None]]] = {}

    def event(self, tick: int, event: Event) -> None:
        """Process an event, in the order of time."""
        if (bound := self._bound.get(event)) is None:
            operations = self._plan.unrolled(event)
            bound = [trace for op in operations if (trace := self._bind(op))]
            self._bound[event] = bound
        for trace in bound:
            trace(tick)

    def _bind(self, operation: Operation) -> Callable[[int], None] | None:
        got, pushed, held, links = self._got, self._pushed, self._held, self._links
        match operation:
            case Get(fmu, ahead):

                def get(tick: int) -> None:
                    got[fmu] = tick + ahead

                return get
            case Push(name, ahead):
                source, link = self._connections[name].source, links.get(name)

                def push(tick: int) -> None:
                    stamp = tick + ahead if ahead else got[source]
                    if link:
                        link.send(stamp)
                    else:
                        pushed[name] = stamp

                return push
            case Evaluate(name) | Blend(name):
                arriving = links.get(name)

                def evaluate(tick: int) -> None:
                    for _, stamp, _ in arriving.arrived(tick) if arriving else ():
                        pushed[name] = stamp
                    held[name] = pushed[name]

                return evaluate
            case Set(fmu, now):
                return self._set(fmu, now)
        return None

    def _set(self, fmu: str, now: bool) -> Callable[[int], None]:
        take, got, held = self._take, self._got, self._held
        inputs = [
            (c.name, held, c.name) if c.hold and not now else (c.name, got, c.source)
            for c in self._incoming[fmu]
        ]

        def used(tick: int) -> None:
            for name, stamps, source in inputs:
                take(tick, name, stamps[source])

        return used


def uses(plan: Plan, until: int | None = None) -> Iterator[Use]:
    """Every value given to every input over the whole run, or up to a tick, in order."""
    pending: list[Use] = []
    stamps = Stamps(plan, lambda *use: pending.append(Use(*use)))
    for tick, event in plan:
        if until is not None and tick > until:
            return
        stamps.event(tick, event)
        yield from pending
        pending.clear()
