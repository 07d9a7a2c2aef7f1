"""Properties of a connection that follow from its ports: names, kind, power, derivative, integral
and gradient."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from hapticlink.components.ports import Kind
from hapticlink.orchestrator.base.errors import InputFault, unknown
from hapticlink.orchestrator.base.signal_names import MECHANISM
from hapticlink.orchestrator.fmi.units import MATRICES, turn
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.scene.scene_tables import PowerPort
from hapticlink.orchestrator.system.system import Connection, Fmu, System


def names(c: Connection) -> tuple[str, str, str]:
    """The names by which a scene may refer to a connection, the most precise first."""
    return (c.name, c.to, c.from_)


def between_plants(c: Connection, fmus: Mapping[str, Fmu]) -> bool:
    """Whether the connection is between two plants of one clock."""
    source, target = fmus[c.source], fmus[c.target]
    return source.clock == target.clock and not source.sampled and not target.sampled


def size(end: str, fmus: Mapping[str, Fmu], *causalities: str) -> int:
    """The number of entries of `fmu.port`; 0 where there is none of these causalities."""
    fmu, _, port = end.partition(".")
    return len(fmus[fmu].description.port(port, *causalities)) if fmu in fmus else 0


def scalars_of(fmus: Mapping[str, Fmu], name: str, *causalities: str) -> tuple[Scalar, ...]:
    """The scalars of `fmu.port`. Raises InputFault where there are none of these causalities."""
    fmu, _, port = name.partition(".")
    if fmu not in fmus:
        raise InputFault(unknown("FMU", fmu, fmus))
    description = fmus[fmu].description
    if scalars := description.port(port, *causalities):
        return scalars
    if texts := [s for s in description.strings if s.name == port and s.causality in causalities]:
        return tuple(texts)
    both = (*description.scalars, *description.strings)
    every = dict.fromkeys(s.port for s in both if s.causality in causalities)
    raise InputFault(f"{fmu}: {unknown(' or '.join(causalities), port, every)}")


def find_power_port(c: Connection, entry: Scalar, power: Iterable[PowerPort]) -> PowerPort | None:
    """The power port of an input of a connection, declared for that entry or for its vector; None
    where there is none."""
    names = (f"{c.target}.{entry.name}", f"{c.target}.{entry.port}")
    return next((p for p in power if p.effort in names), None)


def power_ports(c: Connection, power: Iterable[PowerPort]) -> list[PowerPort | None]:
    """The power port of each input of a connection."""
    own = [p for p in power if p.effort.startswith(f"{c.target}.")]
    return [find_power_port(c, entry, own) if own else None for entry in c.inputs]


def carries_power(c: Connection, power: Iterable[PowerPort]) -> bool:
    """Whether an entry of a connection has a power port."""
    return any(power_ports(c, power))


def power_across_rates(system: System) -> list[str]:
    """Names of the connections that carry power across rates."""
    return [
        c.name
        for c in system.connections
        if carries_power(c, system.energy.power)
        and system.fmu[c.source].clock != system.fmu[c.target].clock
    ]


def kind(c: Connection, fmus: Mapping[str, Fmu]) -> Kind | None:
    """The kind that the source declares for the connection's port; None for single entries of a
    matrix."""
    source = fmus[c.source].description
    port = c.outputs[0].port
    declared = source.kinds.get(port)
    whole = len(c.outputs) == len(source.port(port, "output"))
    return declared if whole or declared not in MATRICES else None


def turns(c: Connection, fmus: Mapping[str, Fmu]) -> dict[int, float]:
    """For each entry that is an angle, by its index, a full turn in its unit."""
    source = fmus[c.source].description
    by_entry = {i: turn(source.unit(s)) for i, s in enumerate(c.outputs)}
    return {i: whole for i, whole in by_entry.items() if whole}


def companion_outputs(
    c: Connection, fmus: Mapping[str, Fmu], hold: str | None = None
) -> tuple[Scalar, ...]:
    """The outputs of the source that `hold`, by default the connection's own, reads beside the
    connection's outputs: their time derivatives or integrals, or where their gradient is taken and
    the gradient, if it needs them; () where the source does not declare them."""
    name, source = hold or c.hold, fmus[c.source].description
    needs = HOLDS[name].needs if name else None
    if needs == "step":
        beside = source.derivative(c.outputs) or source.integral(c.outputs) or ()
        return (*beside, *(acceleration(c, fmus) if beside and c.latency else ()))
    related = {
        "derivative": source.derivative,
        "integral": source.integral,
        "gradient": source.gradient,
    }
    find = related.get(needs or "")
    return (find(c.outputs) or ()) if find else ()


def relation(c: Connection, fmus: Mapping[str, Fmu]) -> str:
    """What the outputs of a source that come first beside those of a connection are to these, by
    its name in loop.h."""
    source = fmus[c.source].description
    if source.derivative(c.outputs):
        return "WITH_RATE"
    return "WITH_POSE" if source.integral(c.outputs) else "ALONE"


def user_of(c: Connection) -> str:
    """What stands before the names of the outputs of the user of which a connection has one:
    "left." of "left.x", nothing for the first."""
    return c.source_port[: c.source_port.rfind(".") + 1]


def acceleration(c: Connection, fmus: Mapping[str, Fmu]) -> tuple[Scalar, ...]:
    """The mobility and the acceleration without efforts of the mechanism's point of which a
    connection has the pose or the velocity; () of others."""
    source, n = fmus[c.source].description, len(c.outputs)
    of_user, port = user_of(c), c.source_port
    known = source.block == MECHANISM and port in (f"{of_user}x", f"{of_user}v")
    found = [
        source.port(f"{of_user}{name}", "output") for name in ("Lambda_inv", "a_bias") if known
    ]
    return (*found[0], *found[1]) if [len(f) for f in found] == [n * n, n] else ()
