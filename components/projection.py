"""Projection of a linkage's state onto its closures, in the metric of D.

    q <- q - A h(q)  (repeated),   qd <- qd - A W(q) qd (repeated),   A = D^-1 W' (W D^-1 W')^-1

A is factored once, at the pose that the integrator left, and used as a chord: each repeat
multiplies the closure error by about the size of the correction itself.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.closure import ClosedLoopSolver
from hapticlink.components.linkage import LinkageModel
from hapticlink.components.tree import TreeInertia

REPEATS = 3


def project(model: LinkageModel, q: ca.SX, qd: ca.SX) -> tuple[ca.SX, ca.SX]:
    """(q, qd), expressions, moved onto h(q) = 0 and W(q) qd = 0; unchanged without a loop."""
    if not model.linkage.loop:
        return q, qd
    p = model.p.vector
    h = ca.Function("h", [model.q, p], [model.h])
    W = ca.Function("W", [model.q, p], [model.W])
    solver = ClosedLoopSolver(TreeInertia(model), model.W)
    closed, rate = model.q, model.qd
    for _ in range(REPEATS):
        closed = closed - solver.constrain(h(closed, p))
    W_closed = W(closed, p)
    for _ in range(REPEATS):
        rate = rate - solver.constrain(W_closed @ rate)
    moved = ca.Function("project", [model.q, model.qd, p], [closed, rate], {"cse": True})
    closed, rate = moved(q, qd, p)
    return closed, rate
