"""Solvers for fixed points of a map, r(w) = g(w) - w = 0, from evaluations of g.

Each solver keeps its relaxation factor or Jacobian for the next call.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from hapticlink.orchestrator.base.arrays import Matrix, Vector

Residual = Callable[[Vector], Vector]


class Solution(NamedTuple):
    """The last point at which r was evaluated; error is its largest |r_i| / (1 + |w_i|)."""

    point: Vector
    residual: Vector
    error: float
    iterations: int


class Solver(Protocol):
    def solve(self, residual: Residual, start: Vector, tolerance: float, most: int) -> Solution:
        """Iterate from `start` until error <= tolerance or `most` points were tried. The last
        evaluation of r is at the point that is returned."""


def error(residual: Vector, point: Vector) -> float:
    """The largest |r_i| / (1 + |w_i|); infinite where it is not finite."""
    largest = np.max(np.abs(residual) / (1.0 + np.abs(point)), initial=0.0)
    return float(largest) if np.isfinite(largest) else np.inf


class Aitken:
    """w <- w + omega r, omega <- -omega r.(r' - r) / |r' - r|^2 (Irons and Tuck 1969; Kuettler and
    Wall 2008, eq. 44), in units of 1 + |w|.

    It may diverge where the Jacobian of r is far from a multiple of 1."""

    def __init__(self) -> None:
        self._omega = 1.0

    def solve(self, residual: Residual, start: Vector, tolerance: float, most: int) -> Solution:
        w, r = start, residual(start)
        for iteration in range(1, most + 1):
            solution = Solution(w, r, error(r, w), iteration)
            if solution.error <= tolerance or iteration == most or np.isinf(solution.error):
                break
            scale = 1.0 + np.abs(w)
            w = w + self._omega * r
            before, r = r, residual(w)
            change = (r - before) / scale
            if length := change @ change:
                omega = -self._omega * float((before / scale) @ change / length)
                if np.isfinite(omega) and omega != 0.0:
                    self._omega = omega
        return solution


class Newton:
    """w <- w - share J^-1 r, with J by finite differences (one evaluation of r per column), updated
    by Broyden's rank-one formula and evaluated anew where a step does not halve the error.

    share is 1 unless the whole step with a new J does not reduce the error, in units of 1 + |w|
    before the step; it is then halved until the step does, as it also does where r is not finite
    (damped Newton: Deuflhard 2011, section 3.1).

    `supplied` may return J at the last point, or None; a supplied J that does not halve the error
    is replaced by differences. `jacobians` counts evaluations of J by differences,
    `supplied_jacobians` those by `supplied`.
    """

    STEP = 1e-6
    """Increment of a finite difference, relative to 1 + |w|."""
    SMALLEST = 2.0**-20
    """Smallest share of a step before the iteration is given up."""

    def __init__(self) -> None:
        self._jacobian: Matrix | None = None
        self.supplied: Callable[[], Matrix | None] = lambda: None
        self.jacobians = self.supplied_jacobians = 0

    def solve(self, residual: Residual, start: Vector, tolerance: float, most: int) -> Solution:
        w, r = start, residual(start)
        fresh = doubted = False
        for iteration in range(1, most + 1):
            solution = Solution(w, r, error(r, w), iteration)
            if solution.error <= tolerance or iteration == most or np.isinf(solution.error):
                break
            if self._jacobian is None:
                self._jacobian = None if doubted else self.supplied()
                fresh, doubted = self._jacobian is None, self._jacobian is not None
                if self._jacobian is None:
                    self._jacobian = self._differences(residual, w, r)
                else:
                    self.supplied_jacobians += 1
            if not np.isfinite(self._jacobian).all():
                self._jacobian = None
                if fresh:
                    residual(w)
                    break
                continue
            step = -np.linalg.lstsq(self._jacobian, r, rcond=None)[0]
            before, w = r, w + step
            r = residual(w)
            if not (reached := error(r, solution.point)) <= solution.error / 2:
                self._jacobian = None
                share = 1.0
                while fresh and not reached < solution.error and share > self.SMALLEST:
                    share /= 2
                    w = solution.point + share * step
                    r = residual(w)
                    reached = error(r, solution.point)
                if not reached < solution.error:
                    w, r = solution.point, residual(solution.point)
                    if fresh:
                        break
                fresh = False
                continue
            doubted = False
            weighted = step / (1.0 + np.abs(w)) ** 2
            change = np.outer(r - before - self._jacobian @ step, weighted)
            self._jacobian = self._jacobian + change / (step @ weighted)
        return solution

    def _differences(self, residual: Residual, w: Vector, r: Vector) -> Matrix:
        self.jacobians += 1
        columns = []
        for i, size in enumerate(self.STEP * (1.0 + np.abs(w))):
            moved = w.copy()
            moved[i] += size
            columns.append((residual(moved) - r) / (moved[i] - w[i]))
        return np.stack(columns, axis=1)


SOLVERS: dict[str, Callable[[], Solver]] = {"aitken": Aitken, "newton": Newton}
