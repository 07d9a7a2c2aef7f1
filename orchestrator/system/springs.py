"""Connections that set the position or velocity of a spring-damper within an FMU, whose energy a
hold can then limit (`pspm`)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping

from hapticlink.orchestrator.fmi.annotation import SPRING_ENDS
from hapticlink.orchestrator.fmi.units import SAME
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import SetSpring
from hapticlink.orchestrator.scene.toml_keys import Problem
from hapticlink.orchestrator.system.ports import size
from hapticlink.orchestrator.system.system import Connection, Fmu, System

NEVER_LATE = (
    "'mid' and 'reaction' have the force by both ends of now, however late its samples are: take "
    "the latency out, or 'half-lead'"
)


def spring(c: Connection, springs: Iterable[SetSpring]) -> SetSpring | None:
    """The spring whose set position or set velocity a connection feeds; None if there is none."""
    return next((s for s in springs if c.to in s.ports), None)


def find_declared_springs(
    fmus: Iterable[Fmu], connections: Collection[Connection]
) -> Iterator[SetSpring]:
    """The spring-dampers that FMUs declare in their annotations, by their names in a system, with
    the start values of their gains. Springs whose gains a connection sets are left out: their
    values are only known once the run begins."""
    fed = {(c.target, s.port) for c in connections if c.to_parameter for s in c.inputs}
    for fmu in fmus:
        for spring in fmu.description.springs:
            if not {(fmu.name, spring.stiffness), (fmu.name, spring.damping)} & fed:
                given = {port: getattr(spring, port) for port in (*SPRING_ENDS, "mobility")}
                yield SetSpring(
                    stiffness=_start_values(fmu, spring.stiffness),
                    damping=_start_values(fmu, spring.damping),
                    **{port: f"{fmu.name}.{name}" for port, name in given.items() if name},
                )


def _start_values(fmu: Fmu, parameter: str) -> tuple[float, ...]:
    given = fmu.start_values
    entries = fmu.description.port(parameter, "parameter")
    return tuple(float(given.get(s.name, s.start)) for s in entries)


def find_limited_gains(system: System) -> set[str]:
    """The gains, `fmu.parameter`, of springs whose energy a hold limits, or whose force it takes
    for the middle of a step: it has their values at the start, so that they may not change while
    the scene runs."""
    held = {c.to for c in system.connections if c.needs == "spring"}
    mids = {(c.source, c.source_port) for c in system.connections if c.needs == "coupling"}
    return {
        f"{fmu.name}.{gain}"
        for fmu in system.fmus
        for spring in fmu.description.springs
        if f"{fmu.name}.{spring.set_position}" in held or (fmu.name, spring.force) in mids
        for gain in (spring.stiffness, spring.damping)
        if gain
    }


def why_unlimited(
    c: Connection,
    springs: Iterable[SetSpring],
    connections: Collection[Connection],
    fmus: Mapping[str, Fmu],
) -> str | None:
    """Why a hold cannot limit the energy of the spring that a connection sets; None if it can."""
    own = spring(c, springs)
    if own is None:
        return (
            f"it sets no spring whose energy is known: write a [[spring]] with {c.to} as its "
            "set_position or set_velocity (docs/passivity.md, pspm), or take another hold"
        )
    fmu, _, name = own.position.partition(".")
    near = next((k for k in connections if k.to == own.position and not k.initial), None)
    if near is None and not fmus[fmu].description.port(name, "output"):
        return f"the near end of its spring, {own.position}, is connected to nothing"
    if near and (near.hold or fmus[near.source].clock != fmus[near.target].clock):
        return f"{own.position} is held too: the near end of its spring must be read unheld"
    if any(gain < 0 for gain in (*own.stiffness, *own.damping)):
        return f"a gain of its spring is below 0: {[*own.stiffness]}, {[*own.damping]}"
    if any(s.conversion != SAME for k in (c, near) if k for s in k.inputs):
        return f"a connection to its spring converts units: connect signals in the units of {fmu}"
    for other in connections:
        if other.to in own.ports and not other.initial and other.hold != c.hold:
            held = f"held by {other.hold!r}" if other.hold else "not held"
            return f"{other.to} sets the same spring and is {held}: give both {c.hold!r}"
    return None


def check_springs(scene: Scene, fmus: Mapping[str, Fmu]) -> Iterator[Problem]:
    """A finding for each [[spring]] with ports that do not exist or that do not fit together."""
    for i, s in enumerate(scene.spring):
        fmu = s.set_position.partition(".")[0]
        inputs = size(s.set_position, fmus, "input")
        for end, kinds in SPRING_ENDS.items():
            port = getattr(s, end)
            if not port:
                continue
            if not (entries := size(port, fmus, *kinds)):
                yield ("spring", i, end), f"there is no {' or '.join(kinds)} {port}"
            elif port.partition(".")[0] != fmu:
                message = f"{port} is not of {fmu}: the ends of a spring are ports of one FMU"
                yield ("spring", i, end), message
            elif inputs and entries != inputs:
                message = f"{port} has {entries} entries, {s.set_position} {inputs}"
                yield ("spring", i, end), message
        if s.mobility and size(s.mobility, fmus, "input") != inputs * inputs:
            message = f"there is no input {s.mobility} with {inputs} times {inputs} entries"
            yield ("spring", i, "mobility"), message
        for gain in ("stiffness", "damping"):
            values = getattr(s, gain)
            if inputs and len(values) != inputs and (values or gain == "stiffness"):
                message = f"{len(values)} gains for the {inputs} of {s.set_position}"
                yield ("spring", i, gain), message
