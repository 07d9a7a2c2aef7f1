"""Slope hold, for the velocity beside a pose that `foh` holds: (x_n - x_{n-1})/H, x the pose.

It is the rate of the held pose x_n + (x_n - x_{n-1}) s/H, so that a spring and damper get a pose
and a velocity that agree; 0 until the second sample, as that pose is constant. As a velocity it is
that of H/2 before t_n: order 1, and a delay of a period at low frequency. The source must have the
pose as an output as well: a sample is the velocity followed by the pose (its unit times s).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.history import History
from hapticlink.orchestrator.holds.hold import Hold


class Slope(Hold):
    needs = "integral"

    def __init__(self, context: HoldContext) -> None:
        self._size, self._seconds = context.size, context.seconds
        self._samples = History(2)

    def push(self, stamp: int, sample: NDArray[np.float64], arrival: int) -> None:
        self._samples.push(stamp, sample)

    def value(self, tick: int, ahead: float = 0.0) -> NDArray[np.float64]:
        if len(self._samples) < 2:
            return np.zeros(self._size)
        (before, first), (stamp, newest) = self._samples[0], self._samples[1]
        return (newest - first)[self._size :] / self._seconds(stamp - before)
