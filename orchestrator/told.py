"""What run.json says of rates, holds, links and energies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from hapticlink.orchestrator.crossings import port
from hapticlink.orchestrator.energy import Energy
from hapticlink.orchestrator.schemes import CAUSAL
from hapticlink.orchestrator.system import System


def holds(system: System) -> dict[str, Any]:
    """Every choice on a connection, and who takes constant inputs in substeps."""
    held = [c for c in system.connections if c.hold]
    return {
        "holds": {c.name: c.hold for c in held},
        "holds_that_did_not_fit": {
            r.connection.name: {"hold": r.hold, "reason": r.reason} for r in system.refused
        },
        "held_as": {c.name: c.kind for c in held if c.kind},
        "latencies": {c.name: asdict(c.latency) for c in held if c.latency},
        "substeps": {u.name: system.substeps.get(u.name, 1) for u in system.units if not u.sampled},
        "get_after_set": list(system.get_after_set),
        "causal": system.coupling in CAUSAL,
        "power_across_rates": power_across_rates(system),
    }


def power_across_rates(system: System) -> list[str]:
    """The connections that cross rates and carry power, by name."""
    return [
        c.name
        for c in system.connections
        if port(c, system.power) and system.unit[c.source].clock != system.unit[c.target].clock
    ]


def energies(system: System, booked: Mapping[str, Energy]) -> dict[str, Any]:
    """In J: `energies` of connections across rates, "none" where none carries power, and those of
    connections within a rate, whose values stand over the target's step all the same."""
    across = set(power_across_rates(system))
    return {
        "energies": {n: asdict(e) for n, e in booked.items() if n in across} or "none",
        "energies_within_a_rate": {n: asdict(e) for n, e in booked.items() if n not in across},
    }
