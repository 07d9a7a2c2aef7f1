"""The two-mass oscillator split in two exact subsystems, so that only coupling error remains.

m x1'' = -k x1 - c v1 + F,   m x2'' = -k x2 - c v2 - F,   F = k_c (x2 - x1) + c_c (v2 - v1)
with m = 1, k = k_c = 100, c = c_c = 1, x = (0, 1), v = (1, 0) at WARM. `one` takes F, `two` x1, v1.
Until WARM both follow the exact solution of the whole, so that every hold has its history.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from hapticlink.orchestrator.scene.records import PowerPort, SetSpring

K, C, K_C, C_C = 100.0, 1.0, 100.0, 1.0
START = np.array([0.0, 1.0, 1.0, 0.0])
"""x1, v1, x2, v2 at WARM."""
WARM = 0.06


def matrix(k_1: float, k_2: float, c: float, k_c: float, c_c: float) -> NDArray[np.float64]:
    """Of (x1, v1, x2, v2): masses of 1 kg on k_1 and k_2 and c, joined by k_c and c_c."""
    one = [-k_1 - k_c, -c - c_c, k_c, c_c]
    two = [k_c, c_c, -k_2 - k_c, -c - c_c]
    return np.array([[0.0, 1.0, 0.0, 0.0], one, [0.0, 0.0, 0.0, 1.0], two])


A = matrix(K, K, C, K_C, C_C)


def exact(times: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([expm(A * (t - WARM)) @ START for t in times])


ROWS = [("two.F", "one.F"), ("one.x", "two.x1"), ("one.v", "two.v1")]

POWER = (PowerPort(effort="one.F", displacement="one.x"),)
SPRINGS = (
    SetSpring(
        set_position="two.x1", position="two.x", set_velocity="two.v1",
        stiffness=(K_C,), damping=(C_C,),
    ),
)  # fmt: skip
