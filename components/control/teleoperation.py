"""Four-channel teleoperation controller (report, section 4.2.3): its two position channels.

The two force channels are connections: the hand's wrench to the mechanism, the contact
wrench F_env to the device.
"""

from __future__ import annotations

import casadi as ca


def drift_wrench(error: ca.SX, error_rate: ca.SX, K_pc: ca.SX, B_pc: ca.SX) -> ca.SX:
    """The virtual coupling F_drift = K_pc (x_S - x_D) + B_pc (v_S - v_D) (N, N, N.m), with gains
    entry by entry.

    It acts with + on the device and with - on the mechanism.
    """
    return K_pc * error + B_pc * error_rate
