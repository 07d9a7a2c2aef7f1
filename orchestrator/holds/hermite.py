"""Cubic Hermite hold: the cubic through the two newest samples and their derivatives.

With s = (t - t_{n-1})/H, H = t_n - t_{n-1}: h00 y_{n-1} + h10 H yd_{n-1} + h01 y_n + h11 H yd_n,
h00 = (1 + 2 s)(1 - s)^2, h10 = s (1 - s)^2, h01 = s^2 (3 - 2 s), h11 = s^2 (s - 1). Order 4. Meant
for interpolation (coupling = "iterated"); extrapolated it amplifies more than the second-order
hold. With one sample it is the first-order hold from the derivative.
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.history import OfSamples
from hapticlink.orchestrator.holds.hold import Vector


class Hermite(OfSamples):
    needs = "derivative"
    degree = 3
    order = 4
    interpolates = True

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        n = self._size
        stamp, newest = self._samples[-1]
        if len(self._samples) < 2:
            return newest[:n] + newest[n:] * self._seconds(tick - stamp + ahead)
        before, first = self._samples[0]
        s, width = (tick - before + ahead) / (stamp - before), self._seconds(stamp - before)
        falling, rising = (1 - s) * (1 - s), s * s
        return (
            (1 + 2 * s) * falling * first[:n]
            + s * falling * width * first[n:]
            + (3 - 2 * s) * rising * newest[:n]
            + (s - 1) * rising * width * newest[n:]
        )
