"""Impedance control (report, section 4.2.1): the device moves as the mechanism would move."""

from __future__ import annotations

import casadi as ca


def desired_acceleration(Lambda_inv: ca.SX, force: ca.SX) -> ca.SX:
    """Lambda^-1 force (m/s2, m/s2, rad/s2), (4.4): zero along the constrained directions."""
    return Lambda_inv @ force


def motor_wrench(M: ca.SX, acceleration: ca.SX, c: ca.SX, F_hand: ca.SX) -> ca.SX:
    """u = M_d a + C_d v - F_h (N, N, N.m): with (4.5) the device's acceleration is exactly a.

    This is (4.6), corrected: as printed, F_h occurs both in M_d Lambda^-1 F_HD, by (4.3), and in
    (M_d Lambda^-1 - I) F_h, so that the hand's wrench would count twice.
    """
    return M @ acceleration + c - F_hand
