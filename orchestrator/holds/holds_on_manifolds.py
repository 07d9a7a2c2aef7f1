"""Holds on manifolds: signals whose entries cannot be extrapolated independently.

projector: a symmetric matrix with eigenvalues 0 and 1. The extrapolated matrix is replaced by the
nearest projector of the same rank, onto the eigenvectors of its largest eigenvalues (Fan and
Hoffman 1955). When the rank changes, the hold starts anew from the new sample.

semidefinite: a symmetric matrix with no negative eigenvalue (Lambda^-1, an inertia). The negative
eigenvalues of the extrapolated matrix are set to 0, in coordinates scaled by the newest sample's
diagonal, so that the result does not depend on units.

angle: an angle (rad, deg, ...) that its FMU wraps. Each sample is unwrapped by whole turns relative
to the sample before.

Matrices behind a hold that only returns samples (`gives_samples`) need none of this. The compiled
loop finds eigenvectors by Jacobi's method (run/compiled/holds_on_manifolds.c), here LAPACK does:
their matrices agree to rounding, all other holds to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.holds.hold import Hold


class Projector(Hold):
    """Wraps a hold: its values are orthogonal projectors with the rank of the newest sample."""

    def __init__(self, make: Callable[[], Hold], size: int) -> None:
        self._make, self.n = make, math.isqrt(size)
        self.hold, self._rank = make(), -1

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        # Of what is no projector, too: no rank is negative or larger than the number of rows.
        trace = max(0.0, float(sample[:: self.n + 1].sum()))
        rank = round(min(trace, self.n))
        if rank != self._rank:
            self.hold, self._rank = self._make(), rank
        self.hold.push(stamp, sample, arrival)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        x = self.hold.value(tick, ahead).reshape(self.n, self.n)
        _, vectors = _eigen((x + x.T) / 2)
        largest = vectors[:, self.n - self._rank :]
        projector: Vector = largest @ largest.T
        return projector.ravel()


class Semidefinite(Hold):
    """Wraps a hold: its values are symmetric positive semidefinite matrices."""

    def __init__(self, make: Callable[[], Hold], size: int) -> None:
        self.n, self.hold = math.isqrt(size), make()
        self._scale = np.ones(self.n)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        diagonal = np.sqrt(np.abs(sample[:: self.n + 1]))
        self._scale = np.where(diagonal > 0.0, diagonal, 1.0)
        self.hold.push(stamp, sample, arrival)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        x = self.hold.value(tick, ahead).reshape(self.n, self.n)
        outer = np.outer(self._scale, self._scale)
        values, vectors = _eigen((x + x.T) / (2 * outer))
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        matrix: Vector = (root @ root.T) * outer
        return matrix.ravel()


def _eigen(matrix: Vector) -> tuple[Vector, Vector]:
    """The eigenvalues of a symmetric matrix, increasing, and its eigenvectors as columns; NaN where
    an entry is not finite, which LAPACK would not take."""
    if not np.isfinite(matrix).all():
        return np.full(len(matrix), np.nan), np.full_like(matrix, np.nan)
    values, vectors = np.linalg.eigh(matrix)
    return values, vectors


class Unwrapped(Hold):
    """Wraps a hold: `angles` are the indices of the entries to unwrap, `turn` a full turn in the
    unit of each."""

    def __init__(
        self, make: Callable[[], Hold], angles: Sequence[int], turn: Sequence[float]
    ) -> None:
        self.hold, self.angles, self.turn = make(), list(angles), np.array(turn)
        self._last: Vector | None = None

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        sample = sample.copy()
        if self._last is not None:
            turns = np.round((self._last - sample[self.angles]) / self.turn)
            sample[self.angles] += self.turn * turns
        self._last = sample[self.angles]
        self.hold.push(stamp, sample, arrival)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self.hold.value(tick, ahead)
