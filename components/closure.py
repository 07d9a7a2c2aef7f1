"""Linear solve of closed-loop dynamics, with bounded work at every pose.

    D a - W' lambda = b,   W a = c        (B.6) with lambda as in (2.3)

The coordinates are eliminated before the constraints that touch them, leaf to root (tree.py);
what remains, S = W D^-1 W', is made definite by mu (quasi-definite: Vanderbei, SIAM J. Optim.
5, 1995), and proximal steps S_mu lambda_{k+1} = r + mu lambda_k take mu out of the answer
again (Parikh & Boyd, Proximal Algorithms, 2014, section 4.1.2). One refinement on the
unregularised system follows. No pivoting, no branch: redundant and singular closures cost
the same as regular ones, and lambda is then of least norm.
"""

from __future__ import annotations

from typing import Protocol

import casadi as ca

from hapticlink.components.tree import symmetric

MU = 1e-8  # relative to trace(S)/m
PROXIMAL_STEPS = 1


class Inertia(Protocol):
    """D as an operator on n x r columns, D^-1 = outward d_inv inward with outward = inward'."""

    n: int
    d_inv: ca.SX

    def inward(self, b: ca.SX) -> ca.SX: ...

    def outward(self, u: ca.SX) -> ca.SX: ...


class UnitInertia:
    """D = 1: changes of least norm."""

    def __init__(self, n: int) -> None:
        self.n = n
        self.d_inv = ca.SX.ones(n)

    def inward(self, b: ca.SX) -> ca.SX:
        return b

    def outward(self, u: ca.SX) -> ca.SX:
        return u


class ClosedLoopSolver:
    """Factors of D and W (m x n); m = 0 leaves D^-1 alone."""

    def __init__(self, inertia: Inertia, W: ca.SX) -> None:
        self.inertia, self.W = inertia, W
        self.m = W.shape[0]
        if self.m:
            self._Z = inertia.inward(W.T)
            self._Y = ca.diag(inertia.d_inv) @ self._Z
            S = symmetric(self._Z.T @ self._Y)
            self._mu = MU * ca.trace(S) / self.m
            self.S = S
            self._S_factor = ca.ldl(ca.sparsify(S + self._mu * ca.SX.eye(self.m)), False)

    def _multipliers(self, residual: ca.SX) -> ca.SX:
        multipliers = ca.ldl_solve(residual, *self._S_factor)
        for _ in range(PROXIMAL_STEPS):
            multipliers = ca.ldl_solve(residual + self._mu * multipliers, *self._S_factor)
        return multipliers

    def solve(self, b: ca.SX, c: ca.SX) -> tuple[ca.SX, ca.SX]:
        """(a, lambda) for right-hand sides b (n x r) and c (m x r)."""
        free = ca.diag(self.inertia.d_inv) @ self.inertia.inward(b)
        if not self.m:
            return self.inertia.outward(free), ca.SX(0, b.shape[1])
        multipliers = self._multipliers(c - self._Z.T @ free)
        a = self.inertia.outward(free + self._Y @ multipliers)
        left = self._multipliers(c - self.W @ a)
        return a + self.inertia.outward(self._Y @ left), multipliers + left

    def constrain(self, c: ca.SX) -> ca.SX:
        """The least change a (in the metric D) with W a = c, unrefined: for iterations that
        correct themselves."""
        return self.inertia.outward(self._Y @ self._multipliers(c))
