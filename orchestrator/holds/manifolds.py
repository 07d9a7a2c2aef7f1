"""Holds on manifolds: signals whose entries cannot be extrapolated independently.

projector: a symmetric matrix with eigenvalues 0 and 1. The extrapolated matrix is replaced by the
nearest projector of the same rank, onto the eigenvectors of its largest eigenvalues (Fan and
Hoffman 1955). When the rank changes, the hold starts anew from the new sample.

semidefinite: a symmetric matrix with no negative eigenvalue (Lambda^-1, an inertia). The negative
eigenvalues of the extrapolated matrix are set to 0, in coordinates scaled by the newest sample's
diagonal, so that the result does not depend on units.

angle: an angle (rad, deg, ...) that its FMU wraps. Each sample is unwrapped by whole turns relative
to the sample before.

Matrices behind a hold that only returns samples (`gives_samples`) need none of this.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.holds.hold import Hold
from hapticlink.orchestrator.holds.symmetric import eigen


class Projector(Hold):
    """Wraps a hold: its values are orthogonal projectors with the rank of the newest sample."""

    def __init__(self, make: Callable[[], Hold], size: int) -> None:
        self._make, self.n = make, math.isqrt(size)
        self.hold, self._rank = make(), -1

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        # Of what is no projector, too: no rank is negative or larger than the number of rows.
        trace = max(0.0, _sum_in_order(sample[:: self.n + 1].tolist()))
        rank = round(min(trace, self.n))
        if rank != self._rank:
            self.hold, self._rank = self._make(), rank
        self.hold.push(stamp, sample, arrival)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        x = self.hold.value(tick, ahead).reshape(self.n, self.n)
        values, vectors = eigen(((x + x.T) / 2).tolist())
        # By how many it is preceded: larger ones, and as large ones with a lower index.
        places = [sum(_before(values, other, k) for other in range(self.n)) for k in range(self.n)]
        return _squared(
            [[r for r, at in zip(row, places, strict=True) if at < self._rank] for row in vectors]
        )


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
        values, vectors = eigen(((x + x.T) / (2 * outer)).tolist())
        roots = [math.sqrt(value if value > 0.0 else 0.0) for value in values]
        return _squared(np.multiply(vectors, roots).tolist()) * outer.ravel()


def _sum_in_order(values: Iterable[float]) -> float:
    """The sum of values, one after the other; Python's `sum` compensates rounding errors since
    3.12, and NumPy's takes another order."""
    total = 0.0
    for value in values:
        total += value
    return total


def _before(values: Sequence[float], i: int, k: int) -> bool:
    return values[i] > values[k] or (values[i] == values[k] and i < k)


def _squared(root: Sequence[Sequence[float]]) -> Vector:
    """root root^T, in one row."""
    products = (
        _sum_in_order(x * y for x, y in zip(one, other, strict=True))
        for one in root
        for other in root
    )
    return np.fromiter(products, np.float64, len(root) ** 2)


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
