"""What the holds of connections read beside their samples: signals of the moment."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.scene.scene_tables import SetSpring
from hapticlink.orchestrator.system import ports
from hapticlink.orchestrator.system.system import Connection, System


class Beside(NamedTuple):
    """What a hold reads beside its samples: the sources of a connection, or its held value, times
    a sign."""

    of: Connection
    held: bool
    sign: float = 1.0


def read_beside(c: Connection, system: System) -> tuple[Beside, ...]:
    """What the hold of a connection reads beside its samples: the coordinates of a gradient; the
    efforts on the FMU whose step is taken early; far and near end of a coupling or of that beside,
    their rates, and the mobility. Raises InputFault where coordinates are not fed by one connection
    as a whole.
    """
    if c.needs == "gradient":
        return (Beside(_coordinates(c, system), held=False),)
    if c.needs == "step":
        return tuple(_efforts(c, system))
    if c.needs == "coupling" and (of := system.energy.coupling(c, system.connections)):
        return _ends(of, system)
    if c.needs == "reaction" and (of := system.energy.coupling_beside(c, system.connections)):
        return _ends(of, system)
    return ()


def _ends(of: SetSpring, system: System) -> tuple[Beside, ...]:
    """Far and near end of a coupling, their rates, and the mobility."""
    into = {i.to: i for i in system.connections}
    return tuple(Beside(i, bool(i.hold)) for i in (into[end] for end in of.ends))


def _coordinates(c: Connection, system: System) -> Connection:
    """The connection into the source with the coordinates in which it declares the gradient of this
    connection's port."""
    description = system.fmu[c.source].description
    by = next(g.by for g in description.gradients.values() if g.of == c.source_port)
    fed = [i for i in system.into(c.source) if i.inputs == description.port(by, "input")]
    if len(fed) != 1:
        raise InputFault(
            f"hold of {c.name}: its gradient is in {c.source}.{by}, which is not fed by one "
            "connection as a whole: take another hold"
        )
    return fed[0]


def _efforts(c: Connection, system: System) -> Iterable[Beside]:
    """The efforts on the source that act along the pose of a connection, where the acceleration by
    these is known."""
    if not ports.acceleration(c, system.fmu) or not c.latency:
        return
    power = system.fmu[c.source].description.power
    for i in system.into(c.source):
        acts = power.get(i.target_port)
        if acts and acts.displacement == f"{ports.user_of(c)}x" and len(i.inputs) == len(c.outputs):
            yield Beside(i, bool(i.hold), acts.sign)
