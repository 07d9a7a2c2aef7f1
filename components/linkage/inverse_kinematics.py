"""Inverse kinematics of a linkage, in numbers: joint coordinates that take the operational point to
a place.

With h(q) = 0 the closures, W = dh/dq, p(q) the position of the operational point (m, 2) and N an
orthonormal basis of null(W), the point is led straight on by

    q <- q + N (dp/dq N)^+ (place - p),   q <- q - W^+ h

from coordinates q of an assembled pose on, so that the assembly of the loops stays the same, and
what the place leaves free, such as the turn of the point, changes as little as possible.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from hapticlink.components.component import Signals
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import body_parameters
from hapticlink.components.specs.linkage import Linkage, coordinates

Vector = NDArray[np.float64]
RANK = 1e-6
"""Singular values, relative to the largest, that count as 0."""
STEADY = 1e-3
"""The same of dp/dq N: next to a singular pose the point is not led on."""
STEPS, LAST, STALLED = 200, 1e-12, 1e-3
"""Steps, the distance (m) at which they end, and the part of it that each takes away at least."""
LARGEST = 0.1
"""Change (rad, m) of a coordinate in a step, so that none leaps over a singular pose."""


@dataclass(frozen=True)
class Reached:
    """Joint coordinates q (n,), and there the pose (m, m, rad) of the operational point and of each
    further point, by name, the largest gap of the closures (m), and in how many directions of the
    plane, 0 to 2, the operational point can move."""

    q: Vector
    point: Vector
    further: dict[str, Vector]
    gap: float
    directions: int


class InverseKinematics:
    """That of a linkage. Raises ValueError as `LinkageModel` does."""

    def __init__(self, linkage: Linkage) -> None:
        variables = body_parameters(linkage)
        n, p = len(coordinates(linkage, {})), Signals("p", variables)
        model = LinkageModel(linkage, p, ca.SX.sym("q", n), ca.SX(n, 1))
        points = [model.x_h, *(model.pose(k.body, f"{k.name}.at") for k in linkage.point)]
        results = [model.h, model.W, ca.jacobian(model.x_h[:2], model.q), ca.horzcat(*points)]
        values = [value for variable in variables for value in variable.starts]
        whole = ca.Function("whole", [model.q, p.vector], results)
        q = ca.SX.sym("q", n)
        self._at = ca.Function("kinematics", [q], [*whole.call([q, ca.SX(ca.DM(values))])])
        self._names = [point.name for point in linkage.point]

    def reached(self, q: Vector, place: Vector) -> Reached:
        """The pose at a place (m, 2), or the nearest to it to which straight steps lead, from
        coordinates q (n,) of an assembled pose on."""
        q, off = np.array(q, float), np.inf
        for _ in range(STEPS):
            h, W, J, points = self._values(q)
            ahead, before = place - points[:2, 0], off
            off = float(np.hypot(*ahead))
            if off < LAST or off > before * (1.0 - STALLED):
                break
            free = self._free(W, len(q))
            moved = free @ np.linalg.pinv(J @ free, STEADY) @ ahead
            q = q + moved / max(1.0, np.abs(moved).max() / LARGEST)
            for _ in range(2):  # Newton's method: what is left is squared twice
                h, W, *_ = self._values(q)
                q = q - np.linalg.pinv(W, RANK) @ h if len(h) else q
        h, W, J, points = self._values(q)
        sizes = np.linalg.svd(J @ self._free(W, len(q)), compute_uv=False)
        further = dict(zip(self._names, points.T[1:], strict=True))
        count = int(np.count_nonzero(sizes > STEADY * max(sizes.max(initial=0.0), 1e-12)))
        return Reached(q, points[:, 0], further, float(np.abs(h).max(initial=0.0)), count)

    def _values(self, q: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        h, W, J, points = (np.array(value) for value in self._at(q))
        return h.ravel(), W, J, points

    @staticmethod
    def _free(W: Vector, n: int) -> Vector:
        basis: Vector = null_space(W, rcond=RANK) if len(W) else np.eye(n)
        return basis
