"""First-order hold: y_n + (y_n - y_{n-1}) s/H with s = t - t_n and H = t_n - t_{n-1}.

Order 2, no delay at low frequency; amplifies at most 1.59-fold, at omega H = 2.13. Zero-order
until the second sample.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.history import History
from hapticlink.orchestrator.holds.hold import Hold


class FirstOrder(Hold):
    degree = 1
    order = 2
    interpolates = True

    def __init__(self, context: HoldContext) -> None:
        self._samples = History(2)

    def push(self, stamp: int, sample: NDArray[np.float64], arrival: int) -> None:
        self._samples.push(stamp, sample)

    def value(self, tick: int, ahead: float = 0.0) -> NDArray[np.float64]:
        stamp, newest = self._samples[-1]
        return newest + self._samples.slope() * (tick - stamp + ahead)
