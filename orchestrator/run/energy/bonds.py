"""Power bonds: the power that a connection carries, entry by entry.

An entry y of the source reaches the target's effort input as e = a y + b (unit conversion, `factor`
and `offset` of the connection), and acts on the displacement x that is paired with that input:
power = sign e dx/dt, in W. Units of the FMUs are converted to SI; an FMU without units is taken to
use N and m, N.m and rad.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.run.signals import SignalVector
from hapticlink.orchestrator.system.ports import paired
from hapticlink.orchestrator.system.system import Connection, System


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


def bond(c: Connection, system: System, signals: SignalVector) -> Bond | None:
    target = system.fmu[c.target].description
    pairs = [(i, s, paired(c, s, system.energy.power)) for i, s in enumerate(c.inputs)]
    carrying = [(i, s, p) for i, s, p in pairs if p]
    if not carrying or c.initial:
        return None
    units = [_factor(target, s) for _, s, _ in carrying]
    moved = [_displacement(target, s, p.effort, p.displacement) for _, s, p in carrying]
    signs = [p.sign * _factor(target, x) for x, (_, _, p) in zip(moved, carrying, strict=True)]
    return Bond(
        tuple(i for i, _, _ in carrying),
        tuple(signals.scalar(c.target, x.name) for x in moved),
        _moving(target, c.target, moved, signals),
        np.array([s.conversion.factor for _, s, _ in carrying]) * units,
        np.array([s.conversion.offset for _, s, _ in carrying]) * units,
        np.array(signs),
    )


def _displacement(target: Description, s: Scalar, effort: str, displacement: str) -> Scalar:
    """The entry of `displacement` with the index that `s` has in `effort`."""
    efforts, moved = (name.partition(".")[2] for name in (effort, displacement))
    place = [e.name for e in target.port(efforts, "input")].index(s.name)
    return target.port(moved, "output")[place]


def _moving(
    target: Description, name: str, moved: Sequence[Scalar], signals: SignalVector
) -> tuple[int, ...]:
    """Indices of the displacements' derivatives in the signal vector; empty unless all exist."""
    return tuple(signals.scalar(name, s.name) for s in target.derivative(moved) or ())


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
        factor: Vector,
        offset: Vector | float = 0.0,
    ) -> None:
        self._values, self._view = signals.values, signals.view(places)
        self.where = np.array(places, dtype=np.intp)
        self.factor: Vector | None = None
        self.offset: Vector | None = None
        if np.any(factor != 1.0) or np.any(offset != 0.0):
            self.factor = np.array(factor, dtype=np.float64)
            self.offset = np.full(len(self.where), offset, dtype=np.float64)

    def __call__(self) -> Vector:
        if self.factor is not None and self.offset is not None:
            return self.factor * self._values[self.where] + self.offset
        return self._values[self.where] if self._view is None else self._view.copy()
