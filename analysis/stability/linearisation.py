"""The linearisation of the lifted map: A = V' dF/dz V, by perturbations that are carried through
the operations of a period (forward_sensitivity.py).

V_j are the unit vectors of the coordinates, or directions within the closures
(closure_directions.py). A number that is overwritten before anything reads it has a zero column and
is left out. A number that nothing changes, a gain that a hold keeps, is a parameter of the lifted
map: its row is that of the identity, and it is left out too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance

from hapticlink.orchestrator.base.arrays import Matrix, Vector

ONE = 1e-7
"""Largest deviation from 1 of the diagonal entry of a parameter."""


@dataclass(frozen=True)
class Linearisation:
    """The map around `point`: F(point) = image, with the Jacobian A (n, n) along the orthonormal
    directions V, the columns of a matrix, and its error E (n, n) by slopes to one side."""

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
        return self.V.T @ (self.image - self.point)

    def moved(self, by: Vector) -> Vector:
        """The point moved along the directions, with all that is overwritten as in the image."""
        return self.image + self.V @ (by - self.change)

    @property
    def scales(self) -> Vector:
        """Scales d of the coordinates that balance A: rows of D^-1 A D as large as its columns."""
        return matrix_balance(self.A, permute=False, separate=True)[1][0]


def constant(A: Matrix, same: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which coordinates nothing changes, not even in turn the others."""
    n = len(A)
    own = np.abs(np.diag(A) - 1.0) < ONE
    alone = np.count_nonzero(A - np.diag(np.diag(A)), axis=1) == 0
    return own & alone & same if n else np.zeros(0, bool)
