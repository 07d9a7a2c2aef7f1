"""Nicosia observer: estimates device velocity and hand force from pose and motor torques.

The report's section 4.2.1 names it (after Nicosia & Tomei 1990) without equations or gains:

    x1' = x2 + k_D e,    M x2' = F_m - C x2 + K_p e,    e = x - x1,    K_p = M omega_n^2

x1 (m, m, rad) follows the measured pose x and x2 the velocity; F_m is the motors' wrench.
For constant M and C = 0 the observed force follows

    F_observed / F = K_p / (M s^2 + k_D M s + K_p).

M and C are constant over a step, so that any rule of `discretisation` applies to the linear system.
At t = 0 x1 is the measured pose and x2 zero: no velocity, no force.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from hapticlink.components.device import discretisation


class State(NamedTuple):
    """x1 (m, m, rad) and x2 (m/s, m/s, rad/s), each (n,)."""

    x1: ca.SX
    x2: ca.SX


@dataclass(frozen=True)
class ForceObserver:
    """The observer with gains omega_n (rad/s) and k_D (1/s), stepped by a rule of
    `discretisation`."""

    rule: str
    omega_n: ca.SX
    k_D: ca.SX

    def step(
        self,
        state: State,
        pose: ca.SX,
        pose_next: ca.SX,
        F_motor: ca.SX,
        M: ca.SX,
        C: ca.SX,
        period: ca.SX,
    ) -> State:
        """The state at the end of a `period` (s), with the pose measured at both ends.

        F_motor is the wrench held over the period; M and C are (n, n), the others (n,). Raises
        ValueError for an unknown rule.
        """
        n = pose.numel()
        identity, zero, K = ca.SX.eye(n), ca.SX(n, n), self.omega_n**2
        A = ca.blockcat([[-self.k_D * identity, identity], [-K * identity, -ca.solve(M, C)]])
        B = ca.blockcat([[self.k_D * identity, zero], [K * identity, identity]])
        push = ca.solve(M, F_motor)
        u, u_next = ca.vertcat(pose, push), ca.vertcat(pose_next, push)
        x = discretisation.step(self.rule, A, B, ca.vertcat(*state), u, u_next, period)
        return State(x[:n], x[n:])

    def force(self, state: State, pose: ca.SX, M: ca.SX) -> ca.SX:
        """Observed hand wrench K_p e (N, N, N.m)."""
        return self.omega_n**2 * (M @ (pose - state.x1))

    def velocity(self, state: State, pose: ca.SX) -> ca.SX:
        """Observed velocity x1' = x2 + k_D e (m/s, m/s, rad/s).

        x2 itself is biased by k_D K_p^-1 F, with F the hand's wrench, which is no input.
        """
        return state.x2 + self.k_D * (pose - state.x1)
