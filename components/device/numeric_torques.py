"""The torques of the device's motors, in numbers."""

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
