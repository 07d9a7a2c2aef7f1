"""Causality read off a plan: which sample each input was made from, without running an FMU."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from hapticlink.orchestrator.plan import Plan
from hapticlink.orchestrator.schemes.operations import Evaluate, Get, Push, Set


class Use(NamedTuple):
    """At `tick` the target of `connection` was given a value made from samples up to `stamp`."""

    tick: int
    connection: str
    stamp: int


def uses(plan: Plan) -> Iterator[Use]:
    """Every value given to every input over the whole run, in order."""
    system = plan.system
    connections = {c.name: c for c in system.connections}
    incoming = {u.name: system.into(u.name) for u in system.units}
    got = dict.fromkeys(system.unit, 0)
    pushed = dict.fromkeys(connections, 0)
    held = dict.fromkeys(connections, 0)
    for tick, event in plan:
        for operation in plan.block(event):
            match operation:
                case Get(fmu):
                    got[fmu] = tick
                case Push(name):
                    pushed[name] = got[connections[name].source]
                case Evaluate(name):
                    held[name] = pushed[name]
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
