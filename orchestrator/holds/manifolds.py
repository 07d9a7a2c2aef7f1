"""What a signal is, where its entries must not be held each for itself.

projector: a symmetric square matrix of eigenvalues 0 and 1. Extrapolated, then taken to the
nearest projector of the same rank, on the eigenvectors of the largest eigenvalues (Fan and
Hoffman 1955). Samples of different rank are never mixed: the hold starts anew.

semidefinite: symmetric with no negative eigenvalue (Lambda^-1, an inertia). Extrapolated, then
its negative eigenvalues are set to 0, in coordinates scaled by the newest sample's diagonal, so
that units do not matter.

angle: entries in rad, deg or the like that an FMU wraps. Unwrapped by whole turns against the
sample before.

Holds that only ever give samples leave the matrices as they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.hold import Hold

Vector = NDArray[np.float64]


class Projector(Hold):
    """A hold whose values are projectors of the rank of its newest sample."""

    def __init__(self, make: Callable[[], Hold], size: int) -> None:
        self._make, self._n = make, math.isqrt(size)
        self._hold, self._rank = make(), -1

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        rank = round(float(sample.reshape(self._n, self._n).trace()))
        if rank != self._rank:
            self._hold, self._rank = self._make(), rank
        self._hold.push(stamp, sample, arrival)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        extrapolated = self._hold.value(tick, ahead).reshape(self._n, self._n)
        vectors = np.linalg.eigh((extrapolated + extrapolated.T) / 2)[1]
        resisted = vectors[:, self._n - self._rank :]
        return (resisted @ resisted.T).ravel()


class Semidefinite(Hold):
    """A hold whose values are symmetric and have no negative eigenvalue."""

    def __init__(self, make: Callable[[], Hold], size: int) -> None:
        self._n, self._hold = math.isqrt(size), make()
        self._scale = np.ones(self._n)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        diagonal = np.sqrt(np.abs(sample.reshape(self._n, self._n).diagonal()))
        self._scale = np.where(diagonal > 0.0, diagonal, 1.0)
        self._hold.push(stamp, sample, arrival)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        extrapolated = self._hold.value(tick, ahead).reshape(self._n, self._n)
        outer = np.outer(self._scale, self._scale)
        values, vectors = np.linalg.eigh((extrapolated + extrapolated.T) / (2 * outer))
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        return (root @ root.T * outer).ravel()


class Unwrapped(Hold):
    """A hold of angles: `angles` are the places of the entries that wrap, `turn` what a turn is in
    the unit of each."""

    def __init__(
        self, make: Callable[[], Hold], angles: Sequence[int], turn: Sequence[float]
    ) -> None:
        self._hold, self._angles, self._turn = make(), list(angles), np.array(turn)
        self._last: Vector | None = None

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        sample = sample.copy()
        if self._last is not None:
            turns = np.round((self._last - sample[self._angles]) / self._turn)
            sample[self._angles] += self._turn * turns
        self._last = sample[self._angles]
        self._hold.push(stamp, sample, arrival)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self._hold.value(tick, ahead)
