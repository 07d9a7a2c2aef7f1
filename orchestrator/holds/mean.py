"""Mean over the slow step: what the source was on average since the target last asked,

(1/(b - a)) integral from a to b of y dt, y straight between samples; a is the newest stamp of the
last time, b the newest of now.

For a fast source and a slow target: what happens between two frames is not lost. Late by half a
period beside the half of the hold itself; order 1. Where no sample came since, the value stays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.hold import Hold

Vector = NDArray[np.float64]


class Mean(Hold):
    downsamples = True

    def __init__(self, context: HoldContext) -> None:
        self._stamp: int | None = None
        self._newest, self._held = np.zeros(context.size), np.zeros(context.size)
        self._sum, self._span = np.zeros(context.size), 0

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        if self._stamp is None:
            self._held[:] = sample
        elif stamp > self._stamp:
            self._sum += (self._newest + sample) * ((stamp - self._stamp) / 2)
            self._span += stamp - self._stamp
        elif not self._span:
            self._held[:] = sample
        self._stamp = stamp
        self._newest[:] = sample

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        if self._span:
            self._held = self._sum / self._span
            self._sum[:], self._span = 0.0, 0
        return self._held
