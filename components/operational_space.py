"""The linkage as the hand feels it: mobility and bias acceleration at the operational point.

    Lambda^-1 = J_h D^-1 (J_h' - W' (W D^-1 W')^-1 W D^-1 J_h')      (B.13); (5.4) without loops
    a_bias    = J_h qdd|_{F=0} + Jdot_h qd

The bias is what (B.7) to (B.13) call negligible: the operational acceleration at zero hand
and drift wrench, from velocities, gravity, springs and drives.
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca

from hapticlink.components.closure import ClosedLoopSolver
from hapticlink.components.linkage import LinkageModel
from hapticlink.components.tree import TreeInertia


class OperationalSpace:
    """Shares one factorisation of the linkage's D and W among all that the hand needs."""

    def __init__(self, model: LinkageModel) -> None:
        self.model = model
        self.solver = ClosedLoopSolver(TreeInertia(model), model.W)

    @cached_property
    def _forced(self) -> tuple[ca.SX, ca.SX]:
        J = self.model.J_h
        return self.solver.solve(J.T, ca.SX(self.solver.m, 3))

    @cached_property
    def _bias(self) -> tuple[ca.SX, ca.SX]:
        return self.solver.solve(self.model.Q - self.model.C_qd, -self.model.w)

    @cached_property
    def Lambda_inv(self) -> ca.SX:
        """3 x 3, symmetric; 1/kg, 1/(kg.m), 1/(kg.m2)."""
        mobility = self.model.J_h @ self._forced[0]
        return 0.5 * (mobility + mobility.T)

    @cached_property
    def a_bias(self) -> ca.SX:
        """3 x 1: m/s2, m/s2, rad/s2."""
        return self.model.J_h @ self._bias[0] + self.model.Jdot_qd

    def motion(self, F: ca.SX) -> tuple[ca.SX, ca.SX]:
        """(qdd, lambda) under the wrench F at the operational point (B.6)."""
        return self._bias[0] + self._forced[0] @ F, self._bias[1] + self._forced[1] @ F
