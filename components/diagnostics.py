"""Rank and condition of the loop closures, by bounded work.

S = W D^-1 W' is factored as L diag(d) L' without pivoting. d_i is what is left of S_ii once the
closures before i hold: next to nothing for a closure that they say already, at this pose or at
all. Such a one does not count. Over the others,

    max S_ii / min d_i  <=  condition of S

is a lower bound of the condition (Golub & Van Loan, Matrix Computations, section 4.2).
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.closure import ClosedLoopSolver
from hapticlink.components.component import Variable

# Relative to the mean of S_ii.
TOLERANCE = 1e-9
MU = 1e-13  # what a dependent closure's pivot is made of, far below TOLERANCE


def outputs() -> list[Variable]:
    return [
        Variable("rank", description="number of closures that are independent at this pose"),
        Variable("condition", description="lower bound of the condition of W D^-1 W'"),
    ]


def values(solver: ClosedLoopSolver) -> dict[str, ca.SX]:
    S, m = solver.S, solver.m
    mean = ca.trace(S) / m
    pivots = ca.vec(ca.ldl(ca.sparsify(S + MU * mean * ca.SX.eye(m)), False)[0])
    counted = pivots > TOLERANCE * mean
    largest = ca.mmax(ca.diag(S))
    least = ca.mmin(ca.if_else(counted, pivots, largest))
    return {"rank": ca.sum1(counted), "condition": largest / least}
