"""Causality of a plan without running an FMU: the stamp of the sample behind each input."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from hapticlink.orchestrator.plan.operations import Blend, Evaluate, Get, Push, Set
from hapticlink.orchestrator.plan.plan import Plan
from hapticlink.orchestrator.system.latency import Link


class Use(NamedTuple):
    """At `tick` the target of `connection` was given a value made from samples up to `stamp`."""

    tick: int
    connection: str
    stamp: int


def uses(plan: Plan, until: int | None = None) -> Iterator[Use]:
    """Every value given to every input over the whole run, or up to a tick, in order."""
    system = plan.system
    connections = {c.name: c for c in system.connections}
    incoming = {u.name: system.into(u.name) for u in system.fmus}
    got = dict.fromkeys(system.fmu, 0)
    pushed = dict.fromkeys(connections, 0)
    held = dict.fromkeys(connections, 0)
    base = system.timeline.base
    links = {c.name: Link(c.latency, base) for c in system.connections if c.hold and c.latency}
    for tick, event in plan:
        if until is not None and tick > until:
            return
        for operation in plan.unrolled(event):
            match operation:
                case Get(fmu, ahead):
                    got[fmu] = tick + ahead
                case Push(name, ahead):
                    stamp = tick + ahead if ahead else got[connections[name].source]
                    if name in links:
                        links[name].send(stamp)
                    else:
                        pushed[name] = stamp
                case Evaluate(name) | Blend(name):
                    for _, stamp, _ in links[name].arrived(tick) if name in links else ():
                        pushed[name] = stamp
                    held[name] = pushed[name]
                case Set(fmu, now) if now:
                    for c in incoming[fmu]:
                        yield Use(tick, c.name, got[c.source])
                case Set(fmu):
                    for c in incoming[fmu]:
                        yield Use(tick, c.name, held[c.name] if c.hold else got[c.source])


@dataclass(frozen=True)
class Delay:
    """How old (s) the newest sample is that an input is made from when it is set."""

    least: float
    most: float
    mean: float


def delays(plan: Plan) -> dict[str, Delay]:
    """By connection. The hold of an input until its next set comes on top.

    The first event is left out: there everything is of t = 0.
    """
    ages: dict[str, list[int]] = {}
    for tick, connection, stamp in uses(plan):
        if tick:
            ages.setdefault(connection, []).append(tick - stamp)
    seconds = plan.system.timeline.seconds
    return {
        name: Delay(seconds(min(a)), seconds(max(a)), seconds(sum(a)) / len(a))
        for name, a in ages.items()
    }
