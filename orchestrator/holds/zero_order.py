"""Zero-order hold: the newest sample, y_n. Order 1; a delay of half a period at low frequency."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.context import HoldContext


class ZeroOrder:
    needs: ClassVar[str | None] = None
    gives_samples: ClassVar[bool] = True
    degree: ClassVar[int] = 0

    def __init__(self, context: HoldContext) -> None:
        self._newest = np.zeros(context.size)

    def push(self, stamp: int, sample: NDArray[np.float64], arrival: int) -> None:
        self._newest[:] = sample

    def value(self, tick: int, ahead: float = 0.0) -> NDArray[np.float64]:
        return self._newest
