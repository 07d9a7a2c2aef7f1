"""What a run can be changed to while it goes on: other holds, latencies and rates."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.capabilities import varies_step
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.system.assign_holds import why_unsuitable
from hapticlink.orchestrator.system.ports import power_across_rates
from hapticlink.orchestrator.system.system import Connection, System


def held_by(c: Connection, hold: str | None, delay: float | None) -> Connection:
    """The connection with another hold or another constant latency (s); None leaves either."""
    latency = c.latency if delay is None else Latency(min=delay) if delay else None
    return replace(c, hold=hold or c.hold, latency=latency)


def changed(system: System, c: Connection, hold: str | None, delay: float | None) -> Connection:
    """`held_by`. Raises InputFault where the hold does not fit, or cannot be changed in a run."""
    new = held_by(c, hold, delay)
    why = why_unsuitable(new.hold or "", new, system.fmu, system.energy.power, False)
    if system.coupling.scheme == "iterated":
        why = "steps are repeated"
    spring = any(f"{c.source}.{c.source_port}" == s.force for s in system.energy.springs)
    on_force = spring and any(d.needs == "spring" for d in system.connections)
    if on_force or "spring" in (c.needs, new.needs):
        why = "holds of a spring share its energy: take `reset`"
    if why:
        raise InputFault(f"hold of {c.name} = {new.hold}: {why}")
    return new


def require_other_rate(system: System, clock: str) -> None:
    """Raises InputFault where a run cannot change the rate of a clock."""
    fixed = [f.name for f in system.fmus if f.clock == clock and not varies_step(f.description)]
    if fixed:
        raise InputFault(f"rate of {clock}: {fixed[0]} takes steps of one size only")
    for c in system.connections:
        if c.needs == "spring" and system.fmu[c.target].clock == clock:
            raise InputFault(
                f"rate of {clock}: `pspm` limits the energy of a spring of {c.target} over the "
                "steps of the start: change the scene, with `reset`"
            )


def choices(system: System, c: Connection) -> list[str]:
    """The holds that a run can give to a connection, its present one first."""
    holds = [c.hold or ""]
    for hold in HOLDS:
        with suppress(InputFault):
            changed(system, c, hold, None)
            holds += [hold] if hold != c.hold else []
    return holds


def choices_of_slower(system: System) -> dict[str, list[str]]:
    """`choices` by connection from a slower clock to the fastest one."""
    fast = system.timeline.clocks[0].name
    slower = (c for c in system.connections if c.hold and system.fmu[c.source].clock != fast)
    return {c.name: choices(system, c) for c in slower}


def choices_between_rates(system: System) -> dict[str, list[str]]:
    """`choices_of_slower`, and those of connections to slower clocks that carry power."""
    power = power_across_rates(system)
    carrying = {
        n: choices(system, c) for n, c in system.connection.items() if n in power and c.hold
    }
    return choices_of_slower(system) | carrying
