"""What can be changed of a scene that runs: inputs and parameters, holds, latencies and rates."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from hapticlink.components.specs.linkage import NO_POINT, Linkage
from hapticlink.orchestrator.base.errors import InputFault, unknown
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.system import springs
from hapticlink.orchestrator.system.assign_holds import why_unsuitable
from hapticlink.orchestrator.system.ports import power_across_rates, scalars_of
from hapticlink.orchestrator.system.system import Connection, System

OPERATIONAL_POINT = "linkage.operational_point"
"""The key that is set to the name of a point while a scene runs."""


def number_of_point(linkage: Linkage | None, name: object) -> int:
    """The value of `virtual_mechanism.point` for a point in the hand. Raises InputFault for a name
    that the linkage does not have."""
    names = (NO_POINT, *(linkage.choices if linkage else ()))
    if len(names) == 1:
        raise InputFault("name the points that it changes between, [linkage.points.NAME]")
    if name not in names:
        raise InputFault(unknown("point", str(name), names))
    return names.index(str(name))


def settable(system: System, name: str) -> tuple[Scalar, ...]:
    """The entries of an input that no connection feeds, or of a tunable parameter, `fmu.port`.
    Raises InputFault for others, and for the gains of a spring of which `pspm` or `mid` has
    those of the start."""
    scalars = scalars_of(system.fmu, name, "input", "parameter")
    if fed := feeding(system, name):
        raise InputFault(f"{name} is fed by a connection, {fed[0].name}")
    if any(s.causality == "parameter" and s.variability != "tunable" for s in scalars):
        raise InputFault(f"{name} is not tunable: change its start value, in the scene")
    if name in springs.find_limited_gains(system):
        raise InputFault(
            f"{name} is a gain of a spring whose energy `pspm` limits or whose force `mid` takes, "
            "which count with that of the start: change its start value, in the scene"
        )
    return scalars


def why_at_start_alone(system: System, fmu: str, scalar: Scalar) -> str:
    """Why a start value acts at the start of a run alone, "" for one that can be set later."""
    if scalar.causality == "parameter" and scalar.variability != "tunable":
        return "is a fixed parameter, which a start alone sets"
    if scalar.causality not in ("input", "parameter") or feeding(system, f"{fmu}.{scalar.name}"):
        return "is a start value, which acts at the start alone"
    if f"{fmu}.{scalar.port}" in springs.find_limited_gains(system):
        return "is a gain of a spring whose hold counts its energy"
    return ""


def feeding(system: System, name: str) -> list[Connection]:
    """The connections that feed an input or parameter, `fmu.port`."""
    named = {s.name for s in scalars_of(system.fmu, name, "input", "parameter")}
    into = system.into(name.partition(".")[0])
    return [c for c in into if named & {s.name for s in c.inputs}]


def with_hold(c: Connection, hold: str | None, delay: float | None) -> Connection:
    """The connection with another hold or another constant latency (s); None leaves either."""
    latency = c.latency if delay is None else Latency(min=delay) if delay else None
    return replace(c, hold=hold or c.hold, latency=latency)


def check_change(
    system: System, c: Connection, hold: str | None, delay: float | None
) -> Connection:
    """`with_hold`. Raises InputFault where the hold does not fit, or cannot be changed in a run."""
    new = with_hold(c, hold, delay)
    why = why_unsuitable(new.hold or "", new, system.fmu, system.energy.power, False)
    if system.coupling.scheme == "iterated":
        why = "steps are repeated"
    on_force = any(c.from_ == s.force for s in system.energy.springs)
    on_force = on_force and any(d.needs == "spring" for d in system.connections)
    if on_force or "spring" in (c.needs, new.needs):
        why = "holds of a spring share its energy: take `reset`"
    if delay and new.needs in ("coupling", "reaction"):
        why = springs.NEVER_LATE
    if c.hold != new.hold and {"step", "coupling", "reaction"} & {c.needs, new.needs}:
        why = "when its samples are taken is planned before the start: take `reset`"
    if why:
        raise InputFault(f"hold of {c.name} = {new.hold}: {why}")
    return new


def result_after(system: System, clock: str) -> float:
    """How long after its begin (s) the result of a step that is taken early is there, the latest of
    a clock."""
    steps = (c for c in system.connections if c.needs == "step")
    late = (c.latency for c in steps if system.fmu[c.source].clock == clock)
    return max((float(each.max or each.min) for each in late if each), default=0.0)


def require_result(system: System, clock: str, shortest: float) -> None:
    """Raises InputFault where steps of a clock would be so short (s) that the next one begins
    before the result of one is there."""
    late = result_after(system, clock)
    if shortest < late:
        raise InputFault(
            f"rate of {clock}: steps would be down to {shortest:.6g} s, and the result of one is "
            f"there after {late:.6g} s (computing_time): take at most {1 / late:.6g} Hz, and less "
            "with a jitter"
        )


def require_other_rate(system: System, clock: str) -> None:
    """Raises InputFault where a run cannot change the rate of a clock."""
    fixed = [f.name for f in system.fmus if f.clock == clock and not f.description.varies_step]
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
            check_change(system, c, hold, None)
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
