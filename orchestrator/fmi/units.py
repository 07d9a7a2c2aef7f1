"""Conversion between the units of the two ends of a connection.

FMI 2.0.5 section 2.2.2 and FMI 3.0 section 2.4.3: a unit is factor x (product of powers of
kg, m, s, A, K, mol, cd, rad) + offset, so y_base = factor y + offset and a signal goes from unit
a to b by y_b = (f_a/f_b) y_a + (o_a - o_b)/f_b. An offset does not count for differences
(relativeQuantity).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np

from hapticlink.components.ports import BASES
from hapticlink.fmus.units import base_unit
from hapticlink.orchestrator.base.arrays import Vector


@dataclass(frozen=True)
class Unit:
    """A unit by name; base holds the exponents of BASES, None where the FMU does not say."""

    name: str
    base: tuple[int, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0

    @classmethod
    def named(cls, name: str) -> Unit:
        """The unit that a name like N.m/s2 stands for. Raises InvalidUnit for other names."""
        return cls(name, tuple(base_unit(name).get(base, 0) for base in BASES))

    @classmethod
    def read(cls, element: Element, space: str = "") -> Unit:
        """The unit of a Unit element of FMI, or of SSP, whose namespace is `space`. Raises
        ValueError for a factor or offset that measures nothing."""
        name, base = element.get("name", ""), element.find(f"{space}BaseUnit")
        if base is None:
            return cls(name)
        powers = tuple(int(base.get(b, "0")) for b in BASES)
        factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
        if not (factor and math.isfinite(factor) and math.isfinite(offset)):
            raise ValueError(
                f"unit {name!r} has factor {factor:g} and offset {offset:g}: a unit is a finite "
                "number of its base unit, and not 0"
            )
        return cls(name, powers, factor, offset)


@dataclass(frozen=True)
class Linear:
    """factor x + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def after(self, first: Linear) -> Linear:
        """The composition: this after `first`."""
        return Linear(self.factor * first.factor, self.factor * first.offset + self.offset)


SAME = Linear()


def factors_and_offsets(conversions: Sequence[Linear]) -> tuple[Vector, Vector] | None:
    """Those of all, (k,); None where nothing is converted."""
    if all(c == SAME for c in conversions):
        return None
    return np.array([c.factor for c in conversions]), np.array([c.offset for c in conversions])


def conversion(source: Unit | None, target: Unit | None, relative: bool = False) -> Linear:
    """The conversion from `source` to `target`; SAME if one of the two has no unit. Raises
    ValueError with the reason if they are not convertible."""
    if source is None or target is None:
        return SAME
    if source.base is None or target.base is None:
        if source.name == target.name:
            return SAME
        unknown = source.name if source.base is None else target.name
        raise ValueError(f"{unknown} has no BaseUnit, so it cannot be converted")
    if source.base != target.base:
        raise ValueError(f"{_write_unit(source)} is not {_write_unit(target)}")
    offset = 0.0 if relative else (source.offset - target.offset) / target.factor
    return Linear(source.factor / target.factor, offset)


def _write_unit(unit: Unit) -> str:
    assert unit.base is not None
    powers = ((b, n) for b, n in zip(BASES, unit.base, strict=True) if n)
    return ".".join(b if n == 1 else f"{b}{n}" for b, n in powers) or "1"


MATRICES = ("projector", "semidefinite")
"""Kinds that are square matrices."""
_ANGLE = tuple(int(base == "rad") for base in BASES)


def turn(unit: Unit | None) -> float | None:
    """A full turn in a unit of angle, 2 pi / factor; 2 pi without a unit, None if the unit is not
    one of angle."""
    if unit is None or (unit.base is None and unit.name == "rad"):
        return math.tau
    return math.tau / unit.factor if unit.base == _ANGLE else None


def why_unsuitable(kind: str, units: Sequence[Unit | None]) -> str | None:
    """The reason why entries with these units cannot be of a kind, None if they can."""
    n = len(units)
    if kind in MATRICES and math.isqrt(n) ** 2 != n:
        return f"has {n} entries, and a {kind} matrix is square"
    if kind == "angle" and not any(map(turn, units)):
        names = ", ".join(dict.fromkeys(u.name for u in units if u))
        return f"is in {names}, which is no angle: give the unit a BaseUnit of rad alone"
    return None
