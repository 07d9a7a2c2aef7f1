"""Generalised coordinate partitioning: Wehage and Haug, J. Mech. Design 104 (1982), 247.

q = (z, y) with a regular block W_y of W at the start pose, by elimination with full pivoting:

    y <- y - W_y^-1 h(z, y)   repeated,   yd = -W_y^-1 W_z zd,   zdd = rows of qdd in (B.6)

The accelerations are those of the formulation by multipliers, of which only zdd is integrated.
Newton's method starts at the pose before the step, with an error of about h |yd| that each of a
fixed number of iterations squares.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from hapticlink.components.component import Signals
from hapticlink.components.linkage.branch import dependent_coordinates
from hapticlink.components.linkage.model import LinkageModel

REPEATS = 4


class Partitioning:
    """The formulation of a model, partitioned at its start pose (q, p); ode is the function
    (x, u, p, t) -> (qd, qdd, s') by multipliers, with x = (q, qd, s)."""

    def __init__(
        self,
        model: LinkageModel,
        parameters: Signals,
        start: tuple[np.ndarray, np.ndarray],
        ode: ca.Function,
    ) -> None:
        n = model.q.numel()
        rows, dependent = dependent_coordinates(model, np.concatenate(start), unseen_first=False)
        self.independent = free = [i for i in range(n) if i not in dependent]
        p, k = parameters.vector, len(free)
        closures = ca.Function("closures", [model.q, p], [model.h[rows], model.W[rows, :]])
        further = ode.numel_out(0) - 2 * n
        state, near = ca.SX.sym("z", 2 * k + further), ca.SX.sym("near", n)
        q = ca.SX(near)
        q[free] = state[:k]
        for _ in range(REPEATS):
            h, W = closures(q, p)
            q[dependent] = q[dependent] - ca.solve(W[:, dependent], h)
        W, qd = closures(q, p)[1], ca.SX(n, 1)
        qd[free] = state[k : 2 * k]
        qd[dependent] = -ca.solve(W[:, dependent], W[:, free] @ qd[free])
        x = ca.vertcat(q, qd, state[2 * k :])
        self.complete = ca.Function("complete", [state, near, p], [x], {"cse": True})
        u, t = ca.SX.sym("u", ode.numel_in(1)), ca.SX.sym("t")
        after = ode(self.complete(state, near, p), u, p, t)
        rates = after[[*free, *(n + i for i in free), *range(2 * n, 2 * n + further)]]
        self.ode = ca.Function("ode", [state, ca.vertcat(u, near), p, t], [rates], {"cse": True})
