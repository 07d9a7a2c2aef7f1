"""Motors and encoders of the device: quantised readings, and in numbers the torques of the motors
and what one count of an encoder looks like to a controller."""

from __future__ import annotations

from dataclasses import asdict
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.device import pantograph
from hapticlink.components.specs.device import Device

Field = NDArray[np.float64]


def quantised(value: ca.SX, quantum: ca.SX, share: float = 0.0) -> ca.SX:
    """quantum floor(value/quantum + share): rounded down by default, to the nearest count by a
    share of 0.5; the value itself where the quantum is 0."""
    return _quantised(value, quantum, share)[0]


def count(angles: ca.SX, resolution: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Angles (rad) by encoders, counts to the nearest one times resolution, and these counts; where
    the resolution is 0, the angles themselves, and counts of one radian."""
    return _quantised(angles, resolution, 0.5)


def _quantised(value: ca.SX, quantum: ca.SX, share: float) -> tuple[ca.SX, ca.SX]:
    coarse = quantum > 0.0
    counts = value / ca.if_else(coarse, quantum, 1.0)
    counts = ca.floor(counts + share if share else counts)
    return ca.if_else(coarse, quantum * counts, value), counts


def numbers(device: Device) -> dict[str, Any]:
    """The device's parameters by name."""
    return {k: v for k, v in asdict(device).items() if isinstance(v, float | int)}


@cache
def torque_function(device: Device) -> ca.Function:
    """Torques (N.m), (4,), of a wrench (N, N, N.m) at a pose (m, m, rad) of the handle, both (3,),
    as the device's motors give them: of least norm, and limited."""
    wrench, pose = ca.SX.sym("wrench", 3), ca.SX.sym("pose", 3)
    tau = pantograph.motor_torques(wrench, pose, numbers(device))
    return ca.Function("torques", [wrench, pose], [tau])


def motor_torques(device: Device, wrenches: Field, poses: Field) -> Field:
    """`torque_function` of wrenches and poses, both (k, 3): (k, 4)."""
    torques = torque_function(device).map(len(wrenches))
    return np.asarray(torques(wrenches.T, poses.T)).T


def count_energies(device: Device, pose: Field, period_s: float) -> Field:
    """The kinetic energies (J), (4,), v' M v/2 with v = (J' J)^-1 J' e_i delta/T, of a handle at
    the pose (m, m, rad) whose measured pose moves by one count delta of encoder i in a period T."""
    x, p = ca.SX.sym("x", 3), numbers(device)
    J = pantograph.jacobian(x, p)
    v = ca.solve(J.T @ J, J.T) * (device.encoder_resolution / period_s)
    M, _ = pantograph.dynamics(x, ca.SX(3, 1), p)
    energies = ca.sum1(v * (M @ v)) / 2
    return np.asarray(ca.Function("energies", [x], [energies])(pose)).ravel()
