"""What one count of an encoder looks like to a controller."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.device import pantograph
from hapticlink.components.device.numeric_torques import numbers
from hapticlink.components.specs.device import Device

Field = NDArray[np.float64]


def count_energies(device: Device, pose: Field, period_s: float) -> Field:
    """The kinetic energies (J), (4,), v' M v/2 with v = (J' J)^-1 J' e_i delta/T, of a handle at
    the pose (m, m, rad) whose measured pose moves by one count delta of encoder i in a period T."""
    x, p = ca.SX.sym("x", 3), numbers(device)
    J = pantograph.jacobian(x, p)
    v = ca.solve(J.T @ J, J.T) * (device.encoder_resolution / period_s)
    M, _ = pantograph.dynamics(x, ca.SX(3, 1), p)
    energies = ca.sum1(v * (M @ v)) / 2
    return np.asarray(ca.Function("energies", [x], [energies])(pose)).ravel()
