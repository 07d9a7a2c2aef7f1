"""Mean of the source since the target last read it, for a fast source and a slow target:

(1/(b - a)) integral from a to b of y dt, y linear between samples; a is the newest stamp at the
previous reading, b the newest stamp now.

What happens between two frames is not lost. Delayed by half a period in addition to the half
period of the hold itself; order 1. Without a new sample the value does not change.
"""

from __future__ import annotations

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.holds.hold import Hold, HoldContext


class Mean(Hold):
    downsamples = True

    def __init__(self, context: HoldContext) -> None:
        self._stamp, self._width = -1, 0
        self._newest, self._held = np.zeros(context.size), np.zeros(context.size)
        self._sum, self._span = np.zeros(context.size), 0

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        if stamp > self._stamp >= 0:
            self._width = stamp - self._stamp
            self._sum += (self._newest + sample) * (self._width / 2)
            self._span += self._width
        elif self._span:  # in place of the newest sample, the end of the last interval
            self._sum += (sample - self._newest) * (self._width / 2)
        elif not self._width:
            self._held[:] = sample
        self._stamp = stamp
        self._newest[:] = sample

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        if self._span:
            self._held = self._sum / self._span
            self._sum[:], self._span = 0.0, 0
        return self._held
