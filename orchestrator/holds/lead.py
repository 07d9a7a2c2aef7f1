"""Half-step lead: y_n + (y_n - y_{n-1})/2, constant until the next sample.

The first-order hold evaluated at the middle of a period: order 2 where the target holds its inputs
constant over the period, and no delay at low frequency. Zero-order until the second sample.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.history import History
from hapticlink.orchestrator.holds.hold import Hold


class Lead(Hold):
    order = 2

    def __init__(self, context: HoldContext) -> None:
        self._samples = History(2)

    def push(self, stamp: int, sample: NDArray[np.float64], arrival: int) -> None:
        self._samples.push(stamp, sample)

    def value(self, tick: int, ahead: float = 0.0) -> NDArray[np.float64]:
        newest = self._samples[-1][1]
        return newest + (newest - self._samples[0][1]) / 2
