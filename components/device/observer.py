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

from typing import NamedTuple

import casadi as ca

from hapticlink.components.device import discretisation


class State(NamedTuple):
    """x1 (m, m, rad) and x2 (m/s, m/s, rad/s), each (n,)."""

    x1: ca.SX
    x2: ca.SX


def step(
    rule: str,
    *,
    x1: ca.SX,
    x2: ca.SX,
    pose: ca.SX,
    pose_next: ca.SX,
    F_motor: ca.SX,
    M: ca.SX,
    C: ca.SX,
    omega_n: ca.SX,
    k_D: ca.SX,
    period: ca.SX,
) -> State:
    """The state at the end of a `period` (s), with the pose measured at both ends.

    F_motor is the wrench held over the period; M and C are (n, n), the others (n,) or scalar.
    Raises ValueError for an unknown rule.
    """
    n = x1.numel()
    identity, zero = ca.SX.eye(n), ca.SX(n, n)
    A = ca.blockcat([[-k_D * identity, identity], [-(omega_n**2) * identity, -ca.solve(M, C)]])
    B = ca.blockcat([[k_D * identity, zero], [omega_n**2 * identity, identity]])
    push = ca.solve(M, F_motor)
    x = discretisation.step(
        rule,
        A,
        B,
        ca.vertcat(x1, x2),
        ca.vertcat(pose, push),
        ca.vertcat(pose_next, push),
        period,
    )
    return State(x[:n], x[n:])


def force(*, x1: ca.SX, pose: ca.SX, M: ca.SX, omega_n: ca.SX) -> ca.SX:
    """Observed hand wrench K_p e (N, N, N.m)."""
    return omega_n**2 * (M @ (pose - x1))


def velocity(*, x1: ca.SX, x2: ca.SX, pose: ca.SX, k_D: ca.SX) -> ca.SX:
    """Observed velocity x1' = x2 + k_D e (m/s, m/s, rad/s).

    x2 itself is biased by k_D K_p^-1 F, with F the hand's wrench, which is no input.
    """
    return x2 + k_D * (pose - x1)
