"""The linearisation of the lifted map by central differences.

    A_ij = V_i' (F(z + d_j V_j) - F(z - d_j V_j)) / 2 d_j,   d_j = 1e-6 max(1, |z|)

V_j are the unit vectors of the coordinates, or directions within the closures (closures.py); |z| is
the largest of the numbers that V_j moves. A number that is overwritten before anything reads it has
a zero column; it is left out as soon as the state after some events is that of z, bit for bit. A
number that nothing changes, a gain that a hold keeps, is a parameter of the map: its row is that of
the identity, and it is left out too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance

from hapticlink.orchestrator.stability.lifted_map import LiftedMap, Vector

Matrix = NDArray[np.float64]
STEP = 1e-6
SAME = 1e-7
"""Largest deviation from 1 of the diagonal entry of a parameter."""


@dataclass(frozen=True)
class Linear:
    """The map around `point`: F(point) = image, with the Jacobian A (n, n) along the orthonormal
    directions V, the columns of a matrix; its error E (n, n) by differences of one side, and per
    column the largest of them relative to the column (`kink`): of order 1 where the map is not
    differentiable."""

    point: Vector
    image: Vector
    V: Matrix
    A: Matrix
    E: Matrix

    @property
    def taken(self) -> NDArray[np.intp]:
        """The coordinates of the state that the directions move."""
        return np.flatnonzero(self.V.any(axis=1))

    @property
    def change(self) -> Vector:
        """Along each direction, F(point) - point."""
        found: Vector = self.V.T @ (self.image - self.point)
        return found

    def moved(self, by: Vector) -> Vector:
        """The point moved along the directions, with all that is overwritten as in the image."""
        found: Vector = self.image + self.V @ (by - self.change)
        return found

    @property
    def kink(self) -> Vector:
        size = np.abs(self.A).max(axis=0, initial=0.0)
        kinks: Vector = np.abs(self.E).max(axis=0, initial=0.0) / np.where(size > 0, size, 1.0)
        return kinks

    @property
    def scales(self) -> Vector:
        """Scales d of the coordinates that balance A: rows of D^-1 A D as large as its columns."""
        found: Vector = matrix_balance(self.A, permute=False, separate=True)[1][0]
        return found


def linearised(map_: LiftedMap, point: Vector) -> Linear:
    """The Jacobian of the map at `point`, along the directions that act on it."""
    nominal: dict[int, Vector] = {}

    def remember(count: int, state: Vector) -> bool:
        nominal[count] = state
        return False

    def lost(count: int, state: Vector) -> bool:
        return np.array_equal(state, nominal[count])

    image = map_(point, remember)
    assert image is not None
    taken, columns, errors = [], [], []
    for along in map_.directions(point):
        d = STEP * max(1.0, float(np.abs(point[along != 0.0]).max()))
        moved = []
        for sign in (1.0, -1.0):
            shifted = point + sign * d * along
            width = along @ (shifted - point)
            found = map_(shifted, lost)
            moved.append(image * 0.0 if found is None else (found - image) / width)
        forward, backward = moved
        if forward.any() or backward.any():
            taken.append(along)
            columns.append((forward + backward) / 2)
            errors.append((forward - backward) / 2)
    if not taken:
        raise AssertionError("a map without a state")
    V = np.stack(taken, axis=1)
    A, E = V.T @ np.stack(columns, axis=1), V.T @ np.stack(errors, axis=1)
    kept = ~_constant(A, V.T @ (image - point) == 0.0)
    return Linear(point, image, V[:, kept], A[kept][:, kept], E[kept][:, kept])


def _constant(A: Matrix, same: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which coordinates nothing changes, not even in turn the others."""
    n = len(A)
    own = np.abs(np.diag(A) - 1.0) < SAME
    alone = np.count_nonzero(A - np.diag(np.diag(A)), axis=1) == 0
    found: NDArray[np.bool_] = own & alone & same if n else np.zeros(0, bool)
    return found
