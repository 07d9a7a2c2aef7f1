"""Projection of a linkage's state onto its closures, in the metric of D.

    q <- q - A h(q)  (repeated),   qd <- qd - A W(q) qd (repeated),   A = D^-1 W' (W D^-1 W')^-1

A is factored once, at the pose after integration (chord method): each repetition multiplies the
closure error by about the size of the correction itself.

Near a singular pose, where sigma, a singular value of W, goes to zero, a gap of rounding size
(1e-16 m) would move the pose by 1e-16/sigma and its rate by 1e-16/sigma^2 along the corresponding
direction, onto another branch. mu is therefore large here. It may be, since the gap that one step
leaves is closed by the next ones, away from the singular pose.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.dynamics.closed_loop_solver import ClosedLoopSolver, Inertia
from hapticlink.components.linkage.model import LinkageModel

REPEATS = 3  # for the pose
RATE_REPEATS = 2
MU = 1e-6  # as in closed_loop_solver.py


def projection(model: LinkageModel, inertia: Inertia) -> ca.Function:
    """The function (q, qd, p) -> (q, qd) that projects onto h(q) = 0 and W(q) qd = 0; the identity
    for a linkage without loops. inertia: the model's own, or another metric."""
    p, closed, rate = model.p.vector, model.q, model.qd
    if model.linkage.closed:
        h = ca.Function("h", [model.q, p], [model.h])
        W = ca.Function("W", [model.q, p], [model.W])
        solver = ClosedLoopSolver(inertia, model.W, model.rows, MU)
        for _ in range(REPEATS):
            closed = closed - solver.constrain(h(closed, p))
        W_closed = W(closed, p)
        for _ in range(RATE_REPEATS):
            rate = rate - solver.constrain(W_closed @ rate)
    return ca.Function("project", [model.q, model.qd, p], [closed, rate], {"cse": True})
