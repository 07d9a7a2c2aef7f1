"""Projection of a linkage's state onto its closures, in the metric of D.

    q <- q - A h(q)  (repeated),   qd <- qd - A W(q) qd (repeated),   A = D^-1 W' (W D^-1 W')^-1

A is factored once, at the pose that the integrator left, and used as a chord: each repeat
multiplies the closure error by about the size of the correction itself.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.closure import ClosedLoopSolver
from hapticlink.components.linkage import LinkageModel

REPEATS = 3


def project(model: LinkageModel, q: ca.SX, qd: ca.SX) -> tuple[ca.SX, ca.SX]:
    """(q, qd) on h(q) = 0 and W(q) qd = 0; unchanged where there is no loop."""
    if not model.linkage.loop:
        return q, qd
    p = model.p.vector
    h = ca.Function("h", [model.q, p], [model.h])
    W = ca.Function("W", [model.q, p], [model.W])
    D = ca.Function("D", [model.q, p], [model.D])
    solver = ClosedLoopSolver(D(q, p), W(q, p))
    for _ in range(REPEATS):
        q = q - solver.constrain(h(q, p))
    W_q = W(q, p)
    for _ in range(REPEATS):
        qd = qd - solver.constrain(W_q @ qd)
    return q, qd
