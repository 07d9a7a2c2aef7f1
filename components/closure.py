"""Linear solve of closed-loop dynamics, with bounded work at every pose.

    D a - W' lambda = b,   W a = c        (B.6) with lambda as in (2.3)

The coordinates are eliminated before the constraints that touch them, leaf to root; what
remains, S = W D^-1 W', is made definite by mu (quasi-definite: Vanderbei, SIAM J. Optim.
5, 1995), and proximal steps S_mu lambda_{k+1} = r + mu lambda_k take mu out of the answer
again (Parikh & Boyd, Proximal Algorithms, 2014, section 4.1.2). One refinement on the
unregularised system follows. No pivoting, no branch: redundant and singular closures cost
the same as regular ones, and lambda is then of least norm.
"""

from __future__ import annotations

import casadi as ca

MU = 1e-8  # relative to trace(S)/m
PROXIMAL_STEPS = 2


class ClosedLoopSolver:
    """Factors of D (n x n) and W (m x n); m = 0 leaves D^-1 alone."""

    def __init__(self, D: ca.SX, W: ca.SX) -> None:
        self.D, self.W = D, W
        n = D.shape[0]
        self._leaf_first = list(range(n - 1, -1, -1))
        order = self._leaf_first
        self._D_factor = ca.ldl(ca.sparsify(D[order, order]), False)
        self.m = W.shape[0]
        if self.m:
            self._Y = self.inverse_inertia(W.T)  # D^-1 W'
            S = W @ self._Y
            self._mu = MU * ca.trace(S) / self.m
            self._S_factor = ca.ldl(ca.sparsify(S + self._mu * ca.SX.eye(self.m)), False)

    def inverse_inertia(self, b: ca.SX) -> ca.SX:
        """D^-1 b for the open tree."""
        order = self._leaf_first
        return ca.ldl_solve(b[order, :], *self._D_factor)[order, :]

    def _solve_once(self, b: ca.SX, c: ca.SX) -> tuple[ca.SX, ca.SX]:
        free = self.inverse_inertia(b)
        residual = c - self.W @ free
        multipliers = ca.ldl_solve(residual, *self._S_factor)
        for _ in range(PROXIMAL_STEPS):
            multipliers = ca.ldl_solve(residual + self._mu * multipliers, *self._S_factor)
        return free + self._Y @ multipliers, multipliers

    def solve(self, b: ca.SX, c: ca.SX) -> tuple[ca.SX, ca.SX]:
        """(a, lambda) for right-hand sides b (n x r) and c (m x r)."""
        if not self.m:
            return self.inverse_inertia(b), ca.SX(0, b.shape[1])
        a, multipliers = self._solve_once(b, c)
        da, dl = self._solve_once(b - self.D @ a + self.W.T @ multipliers, c - self.W @ a)
        return a + da, multipliers + dl

    def constrain(self, c: ca.SX) -> ca.SX:
        """The least change a (in the metric D) with W a = c: `solve` with b = 0."""
        return self.solve(ca.SX(self.D.shape[0], c.shape[1]), c)[0]
