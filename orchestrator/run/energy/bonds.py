"""Power bonds: the power that a connection carries, entry by entry.

An entry y of the source reaches the target's effort input as e = a y + b (unit conversion, `factor`
and `offset` of the connection), and acts on the displacement x that is paired with that input:
power = sign e dx/dt, in W. Units of the FMUs are converted to SI; an FMU without units is taken to
use N and m, N.m and rad.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.scene.scene_tables import PowerPort
from hapticlink.orchestrator.system.ports import power_ports
from hapticlink.orchestrator.system.system import Connection


@dataclass(frozen=True)
class Bond:
    """The entries of a connection that carry power, n of them.

    entries: their indices in the connection. moved: indices of their displacements in the signal
    vector. moving: indices of the displacements' derivatives, empty if the target does not have
    them as outputs. The effort (SI) is factor y + offset, its displacement (SI, with the sign)
    scale x.
    """

    entries: tuple[int, ...]
    moved: tuple[int, ...]
    moving: tuple[int, ...]
    factor: Vector
    offset: Vector
    scale: Vector

    def of(self, places: Sequence[int]) -> list[int]:
        """The elements of `places`, one per entry of the connection, whose entries carry power."""
        return [places[i] for i in self.entries]

    @property
    def work(self) -> Vector:
        """Work (J) of a unit source value over a unit displacement in their own units; (n,)."""
        return self.factor * self.scale


def bond(c: Connection, signals: SignalVector) -> Bond | None:
    target = signals.system.fmu[c.target].description
    pairs = zip(c.inputs, power_ports(c, signals.system.energy.power), strict=True)
    carrying = [(i, s, p.sign, _displacement(target, s, p)) for i, (s, p) in enumerate(pairs) if p]
    if not carrying or c.initial:
        return None
    entries, inputs, signs, moved = zip(*carrying, strict=True)
    units = [_factor(target, s) for s in inputs]

    def places(outputs: Iterable[Scalar]) -> tuple[int, ...]:
        return tuple(signals.scalar(c.target, s.name) for s in outputs)

    return Bond(
        entries,
        places(moved),
        places(target.derivative(moved) or ()),
        np.array([s.conversion.factor for s in inputs]) * units,
        np.array([s.conversion.offset for s in inputs]) * units,
        np.array(signs) * [_factor(target, x) for x in moved],
    )


def _displacement(target: Description, s: Scalar, power: PowerPort) -> Scalar:
    """The entry of the displacement with the index that `s` has in the effort."""
    efforts, moved = (name.partition(".")[2] for name in (power.effort, power.displacement))
    place = [e.name for e in target.port(efforts, "input")].index(s.name)
    return target.port(moved, "output")[place]


def _factor(target: Description, scalar: Scalar) -> float:
    unit = target.unit(scalar)
    return unit.factor if unit else 1.0


class Reader:
    """Reads factor y + offset of the values y at `places`, as a new vector. factor and offset are
    None where all are 1 and 0."""

    def __init__(
        self,
        signals: SignalVector,
        places: Sequence[int],
        factor: Vector | float = 1.0,
        offset: Vector | float = 0.0,
    ) -> None:
        self._values, self.where = signals.values, np.array(places, np.intp)
        self.factor: Vector | None = None
        self.offset: Vector | None = None
        if np.any(factor != 1.0) or np.any(offset != 0.0):
            self.factor, self.offset = (np.full(len(places), v) for v in (factor, offset))

    def __call__(self) -> Vector:
        read: Vector = self._values[self.where]
        if self.factor is None or self.offset is None:
            return read
        return self.factor * read + self.offset
