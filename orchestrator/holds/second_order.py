"""Second-order hold: the quadratic through the three newest samples, in Newton's form,

y_n + d1 (t - t_n) + d2 (t - t_n)(t - t_{n-1}),  d1 = [y_n, y_{n-1}],  d2 = [y_n, y_{n-1}, y_{n-2}]

with divided differences, so that periods may vary. Order 3; amplifies at most 2.83-fold, at
omega H = 2.61. With two samples it is the first-order hold, with one the zero-order hold.
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.history import OfSamples
from hapticlink.orchestrator.holds.hold import Vector


class SecondOrder(OfSamples):
    depth = 3
    degree = 2
    order = 3
    interpolates = True

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        samples = self._samples
        stamp, newest = samples[-1]
        s, slope = tick - stamp + ahead, samples.slope()
        if len(samples) < 3:
            return newest + slope * s
        curve = (slope - samples.slope(-2)) / (stamp - samples[0][0])
        return newest + slope * s + curve * (s * (s + stamp - samples[-2][0]))
