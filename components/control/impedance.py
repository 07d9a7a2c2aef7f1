"""Impedance control (report, section 4.2.1): the device moves as the mechanism would."""

from __future__ import annotations

import casadi as ca


def desired_acceleration(Lambda_inv: ca.SX, force: ca.SX) -> ca.SX:
    """Lambda^-1 force, (4.4): zero along the directions that the mechanism resists."""
    return Lambda_inv @ force


def motor_wrench(M: ca.SX, acceleration: ca.SX, c: ca.SX, F_hand: ca.SX) -> ca.SX:
    """u = M_d a + C_d v - F_h (N, N, N.m): with (4.5) the device accelerates by a exactly.

    (4.6) written out and corrected. Printed, it holds F_h both in M_d Lambda^-1 F_HD, by
    (4.3), and in (M_d Lambda^-1 - I) F_h: the hand would count twice.
    """
    return M @ acceleration + c - F_hand
