"""Fixed points of a map, r(w) = g(w) - w = 0, from values of g alone.

Each solver keeps what it has learned (relaxation, Jacobian) for the next call.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Residual = Callable[[Vector], Vector]


class Found(NamedTuple):
    """The last point at which r was evaluated; error is its largest |r_i| / (1 + |w_i|)."""

    point: Vector
    residual: Vector
    error: float
    iterations: int


class Solver(Protocol):
    def solve(self, residual: Residual, start: Vector, tolerance: float, most: int) -> Found:
        """From `start`, until error <= tolerance or `most` points were tried; the last value of r
        asked for is that of the point found."""


def error(residual: Vector, point: Vector) -> float:
    found = np.max(np.abs(residual) / (1.0 + np.abs(point)), initial=0.0)
    return float(found) if np.isfinite(found) else np.inf


class Aitken:
    """w <- w + omega r, omega <- -omega r.(r' - r) / |r' - r|^2 (Irons and Tuck 1969; Kuettler and
    Wall 2008, eq. 44), in units of 1 + |w|.

    It may diverge where the Jacobian of r is far from a multiple of 1."""

    def __init__(self) -> None:
        self._omega = 1.0

    def solve(self, residual: Residual, start: Vector, tolerance: float, most: int) -> Found:
        w, r = start, residual(start)
        for iteration in range(1, most + 1):
            found = Found(w, r, error(r, w), iteration)
            if found.error <= tolerance or iteration == most or np.isinf(found.error):
                break
            scale = 1.0 + np.abs(w)
            w = w + self._omega * r
            before, r = r, residual(w)
            change = (r - before) / scale
            if length := change @ change:
                omega = -self._omega * float((before / scale) @ change / length)
                if np.isfinite(omega) and omega != 0.0:
                    self._omega = omega
        return found


class Newton:
    """w <- w - J^-1 r; J by differences, one value of r a column, kept and brought up to date by
    Broyden's rank-one change, and made anew where a step does not halve the error.

    `given` may tell J at the point tried last, or None; what it tells is held to the same test, and
    differences take its place. `jacobians` counts how often J was made by differences, `told` how
    often it was given.
    """

    STEP = 1e-6
    """Of 1 + |w|, in a difference."""

    def __init__(self) -> None:
        self._jacobian: Matrix | None = None
        self.given: Callable[[], Matrix | None] = lambda: None
        self.jacobians = self.told = 0

    def solve(self, residual: Residual, start: Vector, tolerance: float, most: int) -> Found:
        w, r = start, residual(start)
        fresh = doubted = False
        for iteration in range(1, most + 1):
            found = Found(w, r, error(r, w), iteration)
            if found.error <= tolerance or iteration == most or np.isinf(found.error):
                break
            if self._jacobian is None:
                self._jacobian = None if doubted else self.given()
                fresh, doubted = self._jacobian is None, self._jacobian is not None
                if self._jacobian is None:
                    self._jacobian = self._differences(residual, w, r)
                else:
                    self.told += 1
            step = -np.linalg.lstsq(self._jacobian, r, rcond=None)[0]
            before, w = r, w + step
            r = residual(w)
            if not error(r, w) <= found.error / 2:
                self._jacobian = None
                if not fresh and not error(r, w) <= found.error:
                    w, r = found.point, residual(found.point)
                fresh = False
                continue
            doubted = False
            weighted = step / (1.0 + np.abs(w)) ** 2
            change = np.outer(r - before - self._jacobian @ step, weighted)
            self._jacobian = self._jacobian + change / (step @ weighted)
        return found

    def _differences(self, residual: Residual, w: Vector, r: Vector) -> Matrix:
        self.jacobians += 1
        columns = []
        for i, size in enumerate(self.STEP * (1.0 + np.abs(w))):
            moved = w.copy()
            moved[i] += size
            columns.append((residual(moved) - r) / (moved[i] - w[i]))
        return np.stack(columns, axis=1)


SOLVERS: dict[str, Callable[[], Solver]] = {"aitken": Aitken, "newton": Newton}
