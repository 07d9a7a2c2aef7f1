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
A = np.array(
    [
        [0.0, 1.0, 0.0, 0.0],
        [-K - K_C, -C - C_C, K_C, C_C],
        [0.0, 0.0, 0.0, 1.0],
        [K_C, C_C, -K - K_C, -C - C_C],
    ]
)


def exact(times: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([expm(A * (t - WARM)) @ START for t in times])


ROWS = [("two.F", "one.F"), ("one.x", "two.x1"), ("one.v", "two.v1")]

POWER = (PowerPort(effort="one.F", displacement="one.x"),)
SPRINGS = (
    SetSpring(
        set_position="two.x1",
        position="two.x",
        stiffness=(K_C,),
        damping=(C_C,),
        set_velocity="two.v1",
    ),
)
