"""Checks that a declared kind (`components.ports.Kind`) fits the entries of an output."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hapticlink.components.ports import BASES
from hapticlink.orchestrator.fmi.units import Unit

MATRICES = ("projector", "semidefinite")
"""Kinds that are square matrices."""
_ANGLE = tuple(int(base == "rad") for base in BASES)


def turn(unit: Unit | None) -> float | None:
    """A full turn in a unit of angle, 2 pi / factor; 2 pi without a unit, None if the unit is not
    one of angle."""
    if unit is None or (unit.base is None and unit.name == "rad"):
        return math.tau
    return math.tau / unit.factor if unit.base == _ANGLE else None


def misfit(kind: str, units: Sequence[Unit | None]) -> str | None:
    """The reason why entries with these units cannot be of a kind, None if they can."""
    n = len(units)
    if kind in MATRICES and math.isqrt(n) ** 2 != n:
        return f"has {n} entries, and a {kind} matrix is square"
    if kind == "angle" and not any(map(turn, units)):
        names = ", ".join(dict.fromkeys(u.name for u in units if u))
        return f"is in {names}, which is no angle: give the unit a BaseUnit of rad alone"
    return None
