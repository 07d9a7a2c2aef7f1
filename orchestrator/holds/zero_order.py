"""Zero-order hold: the newest sample. A delay of half a period at low frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class ZeroOrder:
    def __init__(self, size: int) -> None:
        self._newest = np.zeros(size)

    def push(self, stamp: int, sample: NDArray[np.float64]) -> None:
        self._newest[:] = sample

    def value(self, tick: int) -> NDArray[np.float64]:
        return self._newest
