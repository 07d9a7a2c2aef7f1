"""What run.json says of rates, holds, links and energies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from hapticlink.orchestrator import input_derivatives
from hapticlink.orchestrator.crossings import carries_power
from hapticlink.orchestrator.energy import Energy
from hapticlink.orchestrator.schemes import CAUSAL
from hapticlink.orchestrator.system import System
from hapticlink.orchestrator.ticks import Timeline


def clocks(timeline: Timeline) -> dict[str, Any]:
    """By clock, in s: its first step, and the shortest and longest after it."""
    seconds = timeline.seconds
    return {
        c.name: {
            "first": seconds(c.first),
            "shortest": seconds(c.shortest),
            "longest": seconds(c.longest),
        }
        for c in timeline.clocks
    }


def holds(system: System) -> dict[str, Any]:
    """Every choice on a connection, and how plants take what varies within a step."""
    held = [c for c in system.connections if c.hold]
    return {
        "holds": {c.name: c.hold for c in held},
        "holds_that_did_not_fit": {
            r.connection.name: {"hold": r.hold, "reason": r.reason} for r in system.refused
        },
        "held_as": {c.name: c.kind for c in held if c.kind},
        "latencies": {c.name: asdict(c.latency) for c in held if c.latency},
        "substeps": {u.name: system.substeps.get(u.name, 1) for u in system.units if not u.sampled},
        "within_a_step": within_a_step(system),
        "get_after_set": list(system.get_after_set),
        "causal": system.coupling in CAUSAL,
        "power_across_rates": power_across_rates(system),
    }


def within_a_step(system: System) -> dict[str, str]:
    """By connection, what a plant makes of a hold that varies within its step."""
    return {
        c.name: _taken(input_derivatives.order(system, c), system.substeps.get(c.target, 1))
        for c in system.connections
        if input_derivatives.degree(system, c)
    }


def _taken(order: int, substeps: int) -> str:
    if order:
        renewed = f", renewed in {substeps} substeps" if substeps > 1 else ""
        return f"derivatives to order {order}{renewed}"
    if substeps > 1:
        return f"constant in each of {substeps} substeps"
    return "constant, the hold at the middle (half-step lead)"


def power_across_rates(system: System) -> list[str]:
    """The connections that cross rates and carry power, by name."""
    return [
        c.name
        for c in system.connections
        if carries_power(c, system.power)
        and system.unit[c.source].clock != system.unit[c.target].clock
    ]


def energies(system: System, booked: Mapping[str, Energy]) -> dict[str, Any]:
    """In J: `energies` of connections across rates, "none" where none carries power, and those of
    connections within a rate, whose values stand over the target's step all the same."""
    across = set(power_across_rates(system))
    return {
        "energies": {n: asdict(e) for n, e in booked.items() if n in across} or "none",
        "energies_within_a_rate": {n: asdict(e) for n, e in booked.items() if n not in across},
    }
