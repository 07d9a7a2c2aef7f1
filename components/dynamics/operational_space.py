"""Operational-space dynamics: mobility and bias acceleration at the operational point.

    Lambda^-1 = J_h D^-1 (J_h' - W' (W D^-1 W')^-1 W D^-1 J_h')      (B.13); (5.4) without loops
    a_bias    = J_h qdd|_{F=0} + Jdot_h qd

a_bias is what (B.7) to (B.13) neglect: the operational acceleration at zero hand and drift wrench,
caused by velocities, gravity, springs and drives.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from hapticlink.components import forces
from hapticlink.components.dynamics.articulated_body import TreeInertia
from hapticlink.components.dynamics.closed_loop_solver import ClosedLoopSolver, Inertia
from hapticlink.components.dynamics.redundant_closures import least_pivot
from hapticlink.components.linkage.model import LinkageModel


@dataclass(frozen=True)
class Terms:
    """The terms of (B.6): D as an operator, W, w, J_h, Jdot_h qd, and the efforts Q - C qd."""

    inertia: Inertia
    W: ca.SX
    w: ca.SX
    J_h: ca.SX
    Jdot_qd: ca.SX
    efforts: ca.SX


def own_terms(model: LinkageModel) -> Terms:
    """The terms at the model's own pose and velocity."""
    efforts = forces.efforts(model) - model.C_qd
    return Terms(TreeInertia(model), model.W, model.w, model.J_h, model.Jdot_qd, efforts)


class OperationalSpace:
    """Operational-space quantities that share one factorisation of the linkage's D and W."""

    def __init__(self, model: LinkageModel, terms: Terms | None = None) -> None:
        self.model = model
        self.terms = own_terms(model) if terms is None else terms
        pivot = least_pivot(model.linkage)
        self.solver = ClosedLoopSolver(self.terms.inertia, self.terms.W, model.rows, pivot=pivot)

    def mobility(self, J: ca.SX) -> ca.SX:
        """The mobility J D^-1 (J' - W' (W D^-1 W')^-1 W D^-1 J') of points with Jacobian J (k x n),
        k x k."""
        forced, _ = self.solver.solve(J.T, ca.SX(self.solver.m, J.shape[0]))
        mobility = J @ forced
        return 0.5 * (mobility + mobility.T)

    @cached_property
    def _bias(self) -> tuple[ca.SX, ca.SX]:
        return self.solver.solve(self.terms.efforts, -self.terms.w)

    @cached_property
    def Lambda_inv(self) -> ca.SX:
        """Lambda^-1, 3 x 3 and symmetric; 1/kg, 1/(kg.m), 1/(kg.m2)."""
        return self.mobility(self.terms.J_h)

    def open_mobility(self, J: ca.SX) -> ca.SX:
        """The mobility J D^-1 J' (k x k) of the linkage with open loops, light bodies with added
        inertia."""
        inertia = self.terms.inertia
        passed = inertia.inward(J.T)
        return passed.T @ ca.diag(1 / (inertia.d + inertia.k)) @ passed

    @cached_property
    def a_bias(self) -> ca.SX:
        """The bias acceleration a_bias, 3 x 1 (m/s2, m/s2, rad/s2)."""
        return self.terms.J_h @ self._bias[0] + self.terms.Jdot_qd

    def bias(self, r: ca.SX) -> ca.SX:
        """The bias acceleration of a point with pose r(q)."""
        return ca.jacobian(r, self.model.q) @ self._bias[0] + self.model.rate(self.model.rate(r))

    def response(self, Q: ca.SX) -> tuple[ca.SX, ca.SX]:
        """The change of qdd and lambda by generalised forces Q (n x 1)."""
        return self.solver.solve(Q, ca.SX(self.solver.m, 1))

    def motion(self, Q: ca.SX) -> tuple[ca.SX, ca.SX]:
        """qdd and lambda under generalised forces Q in addition to the linkage's own (B.6)."""
        qdd, multipliers = self.response(Q)
        return self._bias[0] + qdd, self._bias[1] + multipliers
