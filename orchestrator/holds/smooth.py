"""Smooth hold: continuous in value and slope (C1), delayed by a period H = t_n - t_{n-1}.

A cubic Hermite curve from the held value w and slope w' at the arrival of sample n to y_n with the
slope (y_n - y_{n-1})/H, which it reaches H later and continues as a straight line. With r = s/H and
s the time since the arrival:

w (1 + 2r)(1 - r)^2 + w' H r (1 - r)^2 + y_n r^2 (3 - 2r) + (y_n - y_{n-1}) r^2 (r - 1)

Order 1. The first sample is held until the second arrives.
"""

from __future__ import annotations

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.history import History
from hapticlink.orchestrator.holds.hold import Hold


class Smooth(Hold):
    degree = 3

    def __init__(self, context: HoldContext) -> None:
        self._samples = History(2)
        self._arrival = 0
        self._from = self._slope = np.zeros(context.size)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        if len(self._samples):
            self._from, self._slope = self._curve(arrival)
        else:
            self._from = sample.copy()
        self._samples.push(stamp, sample)
        self._arrival = arrival

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self._curve(tick + ahead)[0]

    def _curve(self, time: float) -> tuple[Vector, Vector]:
        """The value and the slope (per tick) at `time` (ticks)."""
        (before, first), (stamp, newest) = self._samples[0], self._samples[-1]
        if stamp == before:
            return newest.copy(), np.zeros_like(newest)
        period, rise = stamp - before, newest - first
        r = (time - self._arrival) / period
        if r >= 1.0:
            return newest + rise * (r - 1.0), rise / period
        start, slope, falling = self._from, self._slope * period, (1.0 - r) * (1.0 - r)
        curve = start * ((1 + 2 * r) * falling) + slope * (r * falling)
        curve += newest * (r * r * (3 - 2 * r)) + rise * (r * r * (r - 1))
        tangent = (newest - start) * (6 * r * (1 - r)) + slope * ((1 - r) * (1 - 3 * r))
        tangent += rise * (r * (3 * r - 2))
        return curve, tangent / period
