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


@dataclass(frozen=True)
class PortSpace:
    """The directions of a port; names: of the entries of its pose, rows: of the six."""

    names: tuple[str, ...]
    rows: tuple[int, ...]

    @property
    def size(self) -> int:
        return len(self.rows)

    @property
    def turns(self) -> tuple[bool, ...]:
        """Whether each entry is an angle."""
        return tuple(row >= LINEAR for row in self.rows)

    def _vector(self, linear: str, angular: str) -> Entries:
        units = tuple(angular if turns else linear for turns in self.turns)
        return Entries((self.size,), units)

    def _matrix(self, linear: str, mixed: str, angular: str) -> Entries:
        units = (linear, mixed, angular)
        of_pairs = tuple(units[a + b] for a in self.turns for b in self.turns)
        return Entries((self.size, self.size), of_pairs)

    @property
    def pose(self) -> Entries:
        return self._vector("m", "rad")

    @property
    def twist(self) -> Entries:
        return self._vector("m/s", "rad/s")

    @property
    def acceleration(self) -> Entries:
        return self._vector("m/s2", "rad/s2")

    @property
    def wrench(self) -> Entries:
        return self._vector("N", "N.m")

    @property
    def mass(self) -> Entries:
        """Inertia by direction."""
        return self._vector("kg", "kg.m2")

    @property
    def stiffness(self) -> Entries:
        """Stiffness by direction."""
        return self._vector("N/m", "N.m/rad")

    @property
    def damping(self) -> Entries:
        """Damping by direction."""
        return self._vector("N.s/m", "N.m.s/rad")

    @property
    def inertia(self) -> Entries:
        return self._matrix("kg", "kg.m", "kg.m2")

    @property
    def mobility(self) -> Entries:
        return self._matrix("1/kg", "1/(kg.m)", "1/(kg.m2)")

    @property
    def projector(self) -> Entries:
        return self._matrix("1", "1", "1")

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

    def _size(self, entries: Vector, *, turns: bool) -> Vector:
        parts = (entries[..., i] for i, turn in enumerate(self.turns) if turn == turns)
        return reduce(np.hypot, parts, np.zeros(entries.shape[:-1]))


LINE = PortSpace(("x",), (0,))
PLANE = PortSpace(("x", "y", "theta"), (0, 1, 5))
"""Planar pose (x m, y m, theta rad) and wrench (N, N, N.m)."""
