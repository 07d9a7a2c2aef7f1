"""Rank and condition of the loop closures, with bounded work.

S = W D^-1 W' is factored as L diag(d) L' without pivoting. The pivot d_i is what remains of S_ii
when the closures before i are satisfied: about zero for a closure that depends on these, at this
pose or at all poses. The rank is the number of the other closures; with B = diag(d)^1/2 L' of
these,

    S = B' B,   G = B B'

have the same nonzero eigenvalues. The condition is the ratio of the largest to the smallest of
them, from Rayleigh quotients after a fixed number of power and of inverse iterations on G (Golub &
Van Loan, Matrix Computations, section 8.2). A quotient lies between the extreme eigenvalues, so
the condition is never overestimated. It is underestimated only if other eigenvalues are close to
the extreme ones.
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
ANY = 1e300  # large values tell of a singular pose, not of a run that has diverged
GOLDEN = 0.6180339887498949


def outputs() -> list[Variable]:
    """The outputs of `mechanism.diagnostics`."""
    rank = "number of closures that are independent at this pose"
    condition = "condition of W D^-1 W' without its zero eigenvalues"
    return [
        Variable("rank", description=rank, on_request=True),
        Variable("condition", description=condition, max=ANY, on_request=True),
    ]


def values(solver: ClosedLoopSolver) -> dict[str, ca.SX]:
    """Rank and condition at the solver's pose; the condition is 1 if the rank is 0."""
    S, m, scale = solver.S, solver.m, solver.scale
    d, upper, _ = ca.ldl(ca.sparsify(S + MU * ca.diag(scale)), False)
    pivots = ca.vec(d)
    counted = ca.if_else(pivots > TOLERANCE * scale, 1, 0)
    B = ca.diag(counted * ca.sqrt(ca.fmax(pivots, 0))) @ (upper + ca.SX.eye(m))
    G = symmetric(B @ B.T)
    factor = ca.ldl(ca.sparsify(G + ca.diag((1 - counted) * scale)), False)
    # The start vector must not be orthogonal to the eigenvectors of the extreme eigenvalues.
    start = counted * ca.DM([0.5 + (i * GOLDEN) % 1 for i in range(1, m + 1)])
    largest = _rayleigh(lambda v: G @ v, start)
    inverse = _rayleigh(lambda v: ca.ldl_solve(v, *factor), start)
    rank = ca.sum1(counted)
    return {"rank": rank, "condition": ca.if_else(rank > 0, largest * inverse, 1)}


def _rayleigh(apply: Callable[[ca.SX], ca.SX], v: ca.SX) -> ca.SX:
    """The Rayleigh quotient v' A v / v' v after power iterations from v: an estimate of the largest
    eigenvalue of the symmetric, positive semidefinite operator A (`apply`)."""
    for _ in range(ITERATIONS):
        v = v / ca.sqrt(ca.dot(v, v) + TINY)
        before, v = v, apply(v)
    return ca.dot(before, v)
