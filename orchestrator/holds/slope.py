"""Slope hold, for the velocity beside a pose that `foh` holds: (x_n - x_{n-1})/H, x the pose.

It is the rate of the held pose x_n + (x_n - x_{n-1}) s/H, so that a spring and damper get a pose
and a velocity that agree; 0 until the second sample, as that pose is constant. As a velocity it is
that of H/2 before t_n: order 1, and a delay of a period at low frequency. The source must have the
pose as an output as well: a sample is the velocity followed by the pose (its unit times s).
"""

from __future__ import annotations

import numpy as np

from hapticlink.orchestrator.holds.history import OfSamples
from hapticlink.orchestrator.holds.hold import Vector


class Slope(OfSamples):
    needs = "integral"

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        if len(self._samples) < 2:
            return np.zeros(self._size)
        (before, first), (stamp, newest) = self._samples[0], self._samples[1]
        return (newest - first)[self._size :] / self._seconds(stamp - before)
