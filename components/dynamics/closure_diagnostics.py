"""Rank and condition of the loop closures, with bounded work.

S = W D^-1 W' is factored as L diag(d) L' without pivoting. The pivot d_i is what remains of S_ii
when the closures before i are satisfied: about zero for a closure that depends on these, at this
pose or at all poses. Such a closure is not counted. With B = diag(d)^1/2 L' of the others,

    S = B' B,   G = B B'

have the same nonzero eigenvalues. The condition is the ratio of the largest to the smallest of
them, from Rayleigh quotients after a fixed number of power and of inverse iterations on G (Golub &
Van Loan, Matrix Computations, section 8.2). A quotient lies between the eigenvalues: the condition
is never overestimated, and underestimated only where other eigenvalues are close to these.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.dynamics.articulated_body import symmetric
from hapticlink.components.dynamics.closed_loop_solver import TINY, ClosedLoopSolver

# Relative to the mean of S_ii over a closure's rows.
TOLERANCE = 1e-9
MU = 1e-13  # replaces the pivot of a dependent closure, far below TOLERANCE
ITERATIONS = 30
GOLDEN = 0.6180339887498949


def outputs() -> list[Variable]:
    return [
        Variable("rank", description="number of closures that are independent at this pose"),
        Variable("condition", description="condition of W D^-1 W', its zeros left out"),
    ]


def values(solver: ClosedLoopSolver) -> dict[str, ca.SX]:
    S, m, scale = solver.S, solver.m, solver.scale
    d, upper, _ = ca.ldl(ca.sparsify(S + MU * ca.diag(scale)), False)
    pivots = ca.vec(d)
    counted = ca.if_else(pivots > TOLERANCE * scale, 1, 0)
    B = ca.diag(counted * ca.sqrt(ca.fmax(pivots, 0))) @ (upper + ca.SX.eye(m))
    G = symmetric(B @ B.T)
    factor = ca.ldl(ca.sparsify(G + ca.diag((1 - counted) * scale)), False)
    # Any start vector works that is not orthogonal to an eigenvector.
    start = counted * ca.DM([0.5 + (i * GOLDEN) % 1 for i in range(1, m + 1)])
    largest = _rayleigh(lambda v: G @ v, start)
    inverse = _rayleigh(lambda v: ca.ldl_solve(v, *factor), start)
    rank = ca.sum1(counted)
    return {"rank": rank, "condition": ca.if_else(rank > 0, largest * inverse, 1)}


def _rayleigh(apply: Callable[[ca.SX], ca.SX], v: ca.SX) -> ca.SX:
    """The largest eigenvalue of a symmetric, positive semidefinite operator."""
    for _ in range(ITERATIONS):
        v = v / ca.sqrt(ca.dot(v, v) + TINY)
        before, v = v, apply(v)
    return ca.dot(before, v)
