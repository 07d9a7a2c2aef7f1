"""First-order hold from the source's own derivative: y_n + yd_n s with s = t - t_n.

Order 2 from the first sample on and no delay at low frequency; unlike `foh` it does not amplify
noise by a difference of samples. The source must have its derivative as an output as well (v
beside x): a sample is y followed by yd (unit of y per s).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.hold import Hold


class FirstOrderDerivative(Hold):
    needs = "derivative"
    degree = 1
    order = 2

    def __init__(self, context: HoldContext) -> None:
        self._size, self._seconds = context.size, context.seconds
        self._stamp = 0
        self._newest, self._slope = np.zeros(context.size), np.zeros(context.size)

    def push(self, stamp: int, sample: NDArray[np.float64], arrival: int) -> None:
        self._stamp = stamp
        self._newest[:], self._slope[:] = sample[: self._size], sample[self._size :]

    def value(self, tick: int, ahead: float = 0.0) -> NDArray[np.float64]:
        return self._newest + self._slope * self._seconds(tick - self._stamp + ahead)
