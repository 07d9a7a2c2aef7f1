"""Half-step lead: y_n + (y_n - y_{n-1})/2, constant until the next sample.

The first-order hold evaluated at the middle of a period: order 2 where the target holds its inputs
constant over the period, and no delay at low frequency. Zero-order until the second sample.
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.history import OfSamples
from hapticlink.orchestrator.holds.hold import Vector


class Lead(OfSamples):
    order = 2

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        newest = self._samples[-1][1]
        return newest + (newest - self._samples[0][1]) / 2
