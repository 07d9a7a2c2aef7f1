"""Delayed interpolation: from the arrival of sample n, a straight line that reaches y_n after
H = t_n - t_{n-1}.

w + (y_n - w) min(1, s/H), with w the held value at the arrival and s the time since then;
w = y_{n-1} at a constant sampling period. Continuous, never overshoots the samples, and delayed
by H: order 1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.history import History
from hapticlink.orchestrator.holds.hold import Hold


class Delayed(Hold):
    degree = 1

    def __init__(self, context: HoldContext) -> None:
        self._samples = History(2)
        self._arrival = 0
        self._from = np.zeros(context.size)

    def push(self, stamp: int, sample: NDArray[np.float64], arrival: int) -> None:
        self._from = self.value(arrival) if len(self._samples) else sample.copy()
        self._samples.push(stamp, sample)
        self._arrival = arrival

    def value(self, tick: int, ahead: float = 0.0) -> NDArray[np.float64]:
        (before, _), (stamp, newest) = self._samples[0], self._samples[-1]
        share = (tick - self._arrival + ahead) / (stamp - before) if stamp > before else 1.0
        return newest if share >= 1.0 else self._from + (newest - self._from) * share
