"""What a connection is by its ports: its names, its power, its angles, its derivative."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from hapticlink.components.base_units import BASES
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.scene.records import PowerPort
from hapticlink.orchestrator.system.haptic_loop import DERIVATIVES
from hapticlink.orchestrator.system.system import Connection, Fmu


def names(c: Connection) -> tuple[str, str, str]:
    """The names under which a scene may speak of a connection, the most precise first."""
    return (c.name, f"{c.target}.{c.target_port}", f"{c.source}.{c.source_port}")


def paired(c: Connection, entry: Scalar, power: Iterable[PowerPort]) -> PowerPort | None:
    """The port of an input of a connection: the one that names it, or the vector that it is of."""
    names = (f"{c.target}.{entry.name}", f"{c.target}.{entry.port}")
    return next((p for p in power if p.effort in names), None)


def carries_power(c: Connection, power: Iterable[PowerPort]) -> bool:
    """Whether an entry of a connection does."""
    power = tuple(power)
    return any(paired(c, entry, power) for entry in c.inputs)


def turns(c: Connection, units: Mapping[str, Fmu]) -> dict[int, float]:
    """A whole turn in the unit of each entry of a connection that is an angle: 2 pi / factor, where
    its only base unit is rad; 2 pi where the source tells no unit."""
    source = units[c.source].description
    found = {i: source.unit(s) for i, s in enumerate(c.outputs)}
    angle = tuple(int(b == "rad") for b in BASES)
    return {
        i: math.tau / (unit.factor if unit else 1.0)
        for i, unit in found.items()
        if unit is None or unit.base == angle or (unit.base is None and unit.name == "rad")
    }


def derivative(c: Connection, units: Mapping[str, Fmu]) -> str | None:
    """The port of the source that is the derivative of what the connection carries."""
    return slope(units[c.source].description, c.source_port, len(c.outputs))


def slope(description: Description, port: str, size: int) -> str | None:
    """The port of `size` outputs that is the derivative of another."""
    for name in (f"der({port})", DERIVATIVES.get(port)):
        if name and len(description.port(name, "output")) == size:
            return name
    return None
