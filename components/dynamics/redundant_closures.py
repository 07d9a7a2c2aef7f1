"""Closures in space that are redundant wherever the linkage moves, as in an overconstrained loop.

Bennett's loop has five rows of rank two, at every pose that closes. Next to such a pose, where the
stages of an integration method are, the rank is three: a gap of g leaves singular values of the
size of g, which are not rounding, and the loop would be locked. Accelerations of such a linkage are
therefore those at the closed pose next to the given one, where the redundant rows are rounding
again, and the solver leaves them out. The equations are the same at every pose that closes, and so
is the order of a method.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.component import Signals
from hapticlink.components.dynamics.closed_loop_solver import PIVOT, UnitInertia
from hapticlink.components.dynamics.projection import projection
from hapticlink.components.linkage.closures import gear_parameters
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import body_parameters
from hapticlink.components.specs.linkage import Linkage, coordinates

RANK = 1e-7
"""Singular values, relative to the largest, that count as 0."""
AWAY, POSES = 0.1, 3
"""By how much (rad, m) coordinates are moved from the start to further poses, and how many."""
DEPENDENT = 1e-12
"""Pivots, as PIVOT of closed_loop_solver.py, of rows that depend on others."""
STEPS, CLOSED = 50, 1e-12
"""Steps to close the loops, and the gap (m) at which they are."""

Vector = NDArray[np.float64]


def nearest_closed(model: LinkageModel) -> ca.Function:
    """(q, p) -> the closed pose next to q, by the least change of coordinates."""
    q, p = model.q, model.p.vector
    closed, _ = projection(model, UnitInertia(q.numel()))(q, model.q * 0, p)
    return ca.Function("closed", [q, p], [closed], {"cse": True})


def least_pivot(linkage: Linkage) -> float:
    """The floor of the pivots of W D^-1 W', relative to the mean of its diagonal over the rows of a
    closure: above rounding by as much as elimination adds where rows are always redundant."""
    return DEPENDENT if is_overconstrained(linkage) else PIVOT


def is_overconstrained(linkage: Linkage) -> bool:
    """Whether closures of a linkage in space are redundant at poses around its start, too; False
    where the loops do not close. Raises ValueError as `LinkageModel` does."""
    if linkage.dimension == 2 or not linkage.closed:
        return False
    from scipy.linalg import null_space  # slow to load

    p = Signals("p", (*body_parameters(linkage), *gear_parameters(linkage)))
    model = LinkageModel.symbolic(linkage, p)
    function = ca.Function("closures", [model.q, p.vector], [model.h, model.W])

    def at(q: Vector) -> tuple[Vector, Vector]:
        h, W = (np.array(value) for value in function(q, p.starts))
        return h.ravel(), W

    def closed(q: Vector) -> Vector | None:
        for _ in range(STEPS):
            h, W = at(q)
            if np.abs(h).max(initial=0.0) < CLOSED:
                return q
            q = q - np.linalg.pinv(W, RANK) @ h
        return None

    start = closed(np.array(coordinates(linkage, linkage.start)))
    if start is None:
        return False
    free, draw = null_space(at(start)[1], RANK), np.random.default_rng(0)
    moves = (free @ draw.uniform(-AWAY, AWAY, free.shape[1]) for _ in range(POSES))
    poses = [q for move in moves if (q := closed(start + move)) is not None]
    ranks = [np.linalg.matrix_rank(W, RANK * np.abs(W).max()) for _, W in map(at, poses)]
    return bool(ranks) and max(ranks) < sum(model.rows)
