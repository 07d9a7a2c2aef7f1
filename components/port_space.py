"""The space of a port: what poses, velocities and wrenches at a point that a hand, a device or an
operational point shares with another are made of.

A port moves in some of the six directions of a rigid body, v = (v_x, v_y, v_z, omega_x, omega_y,
omega_z); its twist and its wrench are those rows of the six. Number, names and units of the
entries, the scaling S that makes turns comparable with lengths, and the difference of two poses
are asked of this record and written nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
LINEAR = 3
"""The first rows of the six, which are lengths; the others are turns."""


class Entries(NamedTuple):
    """Shape of a quantity and the units of its entries, as a `Variable` takes them: `*entries`."""

    shape: tuple[int, ...]
    units: tuple[str, ...]


class _Vector:
    """A quantity with an entry for each direction: its units along lengths and about axes."""

    def __init__(self, linear: str, angular: str) -> None:
        self._units = linear, angular

    def __get__(self, space: PortSpace, _: type[PortSpace]) -> Entries:
        return Entries((space.size,), tuple(self._units[turns] for turns in space.turns))


class _Matrix:
    """A quantity with an entry for each pair of directions: its units for two lengths, one of each,
    and two axes."""

    def __init__(self, linear: str, mixed: str, angular: str) -> None:
        self._units = linear, mixed, angular

    def __get__(self, space: PortSpace, _: type[PortSpace]) -> Entries:
        of_pairs = tuple(self._units[a + b] for a in space.turns for b in space.turns)
        return Entries((space.size, space.size), of_pairs)


@dataclass(frozen=True)
class PortSpace:
    """The directions of a port; names: of the entries of its pose, rows: of the six. Mass,
    stiffness and damping are those by direction."""

    names: tuple[str, ...]
    rows: tuple[int, ...]

    pose = _Vector("m", "rad")
    twist = _Vector("m/s", "rad/s")
    acceleration = _Vector("m/s2", "rad/s2")
    wrench = _Vector("N", "N.m")
    mass = _Vector("kg", "kg.m2")
    stiffness = _Vector("N/m", "N.m/rad")
    damping = _Vector("N.s/m", "N.m.s/rad")
    inertia = _Matrix("kg", "kg.m", "kg.m2")
    mobility = _Matrix("1/kg", "1/(kg.m)", "1/(kg.m2)")
    projector = _Matrix("1", "1", "1")

    @property
    def size(self) -> int:
        return len(self.rows)

    @property
    def turns(self) -> tuple[bool, ...]:
        """Whether each entry is an angle."""
        return tuple(row >= LINEAR for row in self.rows)

    @property
    def lengths(self) -> int:
        """The number of entries that are lengths, which are the first."""
        return self.size - sum(self.turns)

    @property
    def identity(self) -> tuple[float, ...]:
        """The unit matrix, row by row."""
        return tuple(np.eye(self.size).ravel().tolist())

    def scaling(self, length: Any) -> list[Any]:
        """The diagonal of S: 1 for a length, `length` (m) for an angle."""
        return [length if turns else 1 for turns in self.turns]

    def difference(self, pose: Any, other: Any) -> Any:
        """The displacement that takes `other` to `pose`, whose rate is that of their twists."""
        return pose - other

    def distance(self, entries: Vector) -> Vector:
        """The size of what is along lengths in rows (..., n): a distance (m), a force (N)."""
        return self._size(entries, turns=False)

    def angle(self, entries: Vector) -> Vector:
        """The size of what is about axes in rows (..., n): an angle (rad), a moment (N.m)."""
        return self._size(entries, turns=True)

    def moment(self, entries: Vector) -> Vector:
        """What is about the one axis of a port in rows (..., n), with its sign; 0 without one."""
        about = [i for i, turns in enumerate(self.turns) if turns]
        return entries[..., about[0]] if about else np.zeros(entries.shape[:-1])

    def _size(self, entries: Vector, *, turns: bool) -> Vector:
        parts = (entries[..., i] for i, turn in enumerate(self.turns) if turn == turns)
        return reduce(np.hypot, parts, np.zeros(entries.shape[:-1]))


LINE = PortSpace(("x",), (0,))
PLANE = PortSpace(("x", "y", "theta"), (0, 1, 5))
"""Planar pose (x m, y m, theta rad) and wrench (N, N, N.m)."""
POINT = PortSpace(("x", "y", "z"), (0, 1, 2))
"""A point in space (x m, y m, z m) and the force on it (N, N, N)."""
