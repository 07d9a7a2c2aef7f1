"""Zero-order hold: the newest sample, y_n. Order 1; a delay of half a period at low frequency."""

from __future__ import annotations

import numpy as np

from hapticlink.orchestrator.holds.hold import Hold, HoldContext, Vector


class ZeroOrder(Hold):
    gives_samples = True
    interpolates = True

    def __init__(self, context: HoldContext) -> None:
        self._newest = np.zeros(context.size)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self._newest[:] = sample

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        return self._newest


class Latest(ZeroOrder):
    """The zero-order hold under the name that it has where a slow target reads a fast source."""

    interpolates = False
    downsamples = True
