"""Solution of the closed-loop equations of motion, with the same bounded work at every pose.

    D a - W' lambda = b,   W a = c        (B.6) with lambda as in (2.3)

The coordinates are eliminated before the constraints, leaf to root (articulated_body.py); the Schur
complement that remains, S = W D^-1 W', is made definite by mu (quasi-definite: Vanderbei, SIAM J.
Optim. 5, 1995), and iterative refinement on the unregularised system or proximal steps remove the
effect of mu again. There is no pivoting and no branch: redundant and singular closures cost the
same as regular ones.

mu is relative to the mean of S_ii over the rows of each closure, so that loops of heavy and of
light links count alike, independently of the frame. Where an eigenvalue sigma^2 of S, scaled so, is
below mu, the closure does not act along its direction. The right mu near a singular pose depends on
the right-hand side. W D^-1 b is in the range of W by construction, and cutting it would leave the
linkage the acceleration of the open tree: there mu is zero, and the pivots of S have a floor at its
rounding instead, for redundant closures. c = -Wdot qd is in the range of W only for rates that
satisfy the closures; the error of other rates is divided by sigma. `follow` therefore cuts c early,
and is meant for accelerations that are integrated.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import accumulate
from typing import Protocol

import casadi as ca

from hapticlink.components.dynamics.articulated_body import symmetric

ROUNDING = 1e-16  # of S: a loop whose rows are all below it is ignored
TINY = 1e-200

# Relative to the mean of S_ii over a closure's rows.
PIVOT = 1e-15
MU_FOLLOWING = 1e-6  # for c in `follow`
MU_MULTIPLIERS = 1e-9  # for multipliers of least norm: rounding along null(W') is divided by it
PROXIMAL_STEPS = 2


class Inertia(Protocol):
    """D as an operator on n x r matrices, D^-1 = outward diag(d)^-1 inward with outward = inward'.

    k (n x 1) is added to d in the metric of the closures; it is zero except for light bodies."""

    n: int
    d: ca.SX
    k: ca.SX

    def inward(self, b: ca.SX) -> ca.SX: ...

    def outward(self, u: ca.SX) -> ca.SX: ...


class UnitInertia:
    """The identity D = 1, for changes of least Euclidean norm."""

    def __init__(self, n: int) -> None:
        self.n = n
        self.d, self.k = ca.SX.ones(n), ca.SX(n, 1)

    def inward(self, b: ca.SX) -> ca.SX:
        return b

    def outward(self, u: ca.SX) -> ca.SX:
        return u


def closure_scale(S: ca.SX, rows: Sequence[int]) -> ca.SX:
    """Mean of S_ii over the rows of each closure, m x 1; independent of the frame's rotation."""
    least = ROUNDING * ca.trace(S) / S.shape[0] + TINY
    parts = ca.vertsplit(ca.densify(ca.diag(S)), [0, *accumulate(rows)])
    scales = [ca.fmax(ca.sum1(part) / part.numel(), least) for part in parts]
    return ca.vertcat(*(ca.repmat(s, k) for s, k in zip(scales, rows, strict=True)))


class Factored:
    """Factorisation L diag(d) L' of a symmetric matrix without pivoting; pivots d below `least` are
    raised to it, if given."""

    def __init__(self, A: ca.SX, least: ca.SX | None = None) -> None:
        m, nonzero = A.shape[0], A.sparsity().has_nz
        left = [{i: A[i, j] for i in range(j, m) if nonzero(i, j)} for j in range(m)]
        self._inverse: list[ca.SX] = []
        pivots: list[ca.SX] = []
        self._columns: list[dict[int, ca.SX]] = []
        for j, column in enumerate(left):
            pivot = column.pop(j, ca.SX(0))
            pivots.append(pivot if least is None else ca.fmax(pivot, least[j]))
            self._inverse.append(1 / pivots[j])
            scaled = {i: a * self._inverse[j] for i, a in column.items()}
            for i, a in column.items():
                for k, entry in scaled.items():
                    if k >= i:
                        left[i][k] = left[i].get(k, ca.SX(0)) - entry * a
            self._columns.append(scaled)
        self.pivots = ca.vertcat(*pivots)

    def forward(self, b: ca.SX) -> ca.SX:
        """L^-1 b, m x r."""
        x = [b[i, :] for i in range(b.shape[0])]
        for j, column in enumerate(self._columns):
            for i, entry in column.items():
                x[i] = x[i] - entry * x[j]
        return ca.vertcat(*x)

    def backward(self, u: ca.SX) -> ca.SX:
        """L'^-1 u, m x r."""
        x = [u[i, :] for i in range(u.shape[0])]
        for j, column in reversed(list(enumerate(self._columns))):
            for i, entry in column.items():
                x[j] = x[j] - entry * x[i]
        return ca.vertcat(*x)

    def solve(self, b: ca.SX) -> ca.SX:
        """x of A x = b, m x r."""
        return self.backward(ca.diag(ca.vertcat(*self._inverse)) @ self.forward(b))


class Regularised(Factored):
    """Factorisation of S + diag(shift) for a symmetric, positive semidefinite S."""

    def __init__(self, S: ca.SX, shift: ca.SX) -> None:
        self.shift = ca.diag(shift)
        super().__init__(S + self.shift)

    def proximal(self, b: ca.SX) -> ca.SX:
        """y with S y = b by proximal steps S_mu y_{k+1} = b + mu y_k, which remove the effect of mu
        (Parikh & Boyd, Proximal Algorithms, 2014, section 4.1.2)."""
        y = self.solve(b)
        for _ in range(PROXIMAL_STEPS):
            y = self.solve(b + self.shift @ y)
        return y


class MatrixInertia:
    """D from its entries as an `Inertia`, D = L diag(d) L' in an `order` of elimination, leaf to
    root, with pivots d of at least `least`, if given; k as there."""

    def __init__(self, D: ca.SX, k: ca.SX, order: list[int], least: ca.SX | None = None) -> None:
        self.n, self.k, self._order = D.shape[0], k, order
        least = None if least is None else least[order]
        self._factored = Factored(symmetric(D[order, order]), least)
        self.d = self._placed(self._factored.pivots)

    def inward(self, b: ca.SX) -> ca.SX:
        return self._placed(self._factored.forward(b[self._order, :]))

    def outward(self, u: ca.SX) -> ca.SX:
        return self._placed(self._factored.backward(u[self._order, :]))

    def _placed(self, ordered: ca.SX) -> ca.SX:
        placed = ca.SX(*ordered.shape)
        placed[self._order, :] = ordered
        return placed


class ClosedLoopSolver:
    """Factors of D and W (m x n), with the number of rows of each closure; for m = 0 it applies
    D^-1. pivot: the floor of the pivots of S without mu."""

    def __init__(
        self,
        inertia: Inertia,
        W: ca.SX,
        rows: Sequence[int],
        mu: float | None = None,
        pivot: float = PIVOT,
    ) -> None:
        self.inertia, self.W, self.m = inertia, W, W.shape[0]
        self._d_inv = ca.diag(1 / (inertia.d + inertia.k))
        self._light = inertia.k.sparsity().row()
        if self.m:
            self._Z = inertia.inward(W.T)
            self._Y = self._d_inv @ self._Z
            self.S = symmetric(self._Z.T @ self._Y)
            self.scale = closure_scale(self.S, rows)
            self._sharp = (
                Factored(self.S, pivot * self.scale)
                if mu is None
                else Regularised(self.S, mu * self.scale)
            )

    @cached_property
    def _following(self) -> Regularised:
        return Regularised(self.S, MU_FOLLOWING * self.scale)

    @cached_property
    def _left_free(self) -> Factored:
        """Factorised inertia of the light coordinates with the loops closed."""
        d, k, Z = (v[self._light, :] for v in (self.inertia.d, self.inertia.k, self._Z))
        return Factored(symmetric(ca.diag(d * (d + k) / k) + Z @ self._sharp.solve(Z.T)))

    def _closed(self, beta: ca.SX, c: ca.SX) -> tuple[ca.SX, ca.SX]:
        """(v, lambda) with d u - Z lambda = beta and Z' u = c for u = v + Y lambda."""
        light, Z = self._light, self._Z
        v = self._d_inv @ beta
        y = self._sharp.solve(c - Z.T @ v)
        if light:
            w = ca.SX(*beta.shape)
            w[light, :] = self._left_free.solve(beta[light, :] + Z[light, :] @ y)
            v += w
            y = self._sharp.solve(c - Z.T @ v)
        return v, y

    def _shortest(self, multipliers: ca.SX) -> ca.SX:
        """The part of the multipliers in the range of W: the least-norm solution. Columns of W are
        scaled to unit length, so that it does not depend on units and masses; mu is equal for all
        rows."""
        columns = ca.sum1(self.W**2).T
        A = symmetric(self.W @ ca.diag(1 / (columns + TINY)) @ self.W.T)
        equal = MU_MULTIPLIERS * ca.SX.ones(self.m)
        return Regularised(A, equal).proximal(A @ multipliers)

    def solve(self, b: ca.SX, c: ca.SX) -> tuple[ca.SX, ca.SX]:
        """(a, lambda), lambda of least norm, for right-hand sides b (n x r) and c (m x r)."""
        inertia, beta = self.inertia, self.inertia.inward(b)
        if not self.m:
            return inertia.outward(self._d_inv @ beta), ca.SX(0, b.shape[1])
        v, y = self._closed(beta, c)
        u = v + self._Y @ y
        a = inertia.outward(u)
        # Refinement: the residual of the closures, then that of the light coordinates' efforts.
        none = ca.SX(*beta.shape)
        v, also = self._closed(none, c - self.W @ a)
        more, y = v + self._Y @ also, y + also
        if self._light:
            u, missed = u + more, none
            for i in self._light:
                missed[i, :] = beta[i, :] + self._Z[i, :] @ y - inertia.d[i] * u[i, :]
            v, also = self._closed(missed, ca.SX(*c.shape))
            more, y = more + v + self._Y @ also, y + also
        return a + inertia.outward(more), self._shortest(y)

    def follow(self, b: ca.SX, c: ca.SX, *, refined: bool = False) -> ca.SX:
        """The accelerations a as in `solve` (n x r), for rates that nearly satisfy the closures;
        with one step of refinement if `refined`."""
        inertia, beta = self.inertia, self.inertia.inward(b)
        if not self.m:
            return inertia.outward(self._d_inv @ beta)
        particular = self._following.proximal(c)
        taken_back = ca.diag(inertia.k) @ (self._Y @ particular)
        v, y = self._closed(beta + taken_back, ca.SX(*c.shape))
        if refined:
            y += self._sharp.solve(-self._Z.T @ (v + self._Y @ y))
        return inertia.outward(v + self._Y @ (y + particular))

    def constrain(self, c: ca.SX) -> ca.SX:
        """The smallest change a in the metric of d + k with W a = c, without refinement: for
        iterations that correct themselves."""
        return self.inertia.outward(self._Y @ self._sharp.solve(c))
