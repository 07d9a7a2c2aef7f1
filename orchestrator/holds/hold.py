"""What every hold is."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


class Hold(Protocol):
    """Times are ticks of the plan's base. A hold has a sample before it is asked for a value."""

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        """Take a sample that is true at `stamp` and known from `arrival` on; stamps never fall.
        `sample` is only valid during the call."""

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        """What the target reads at `tick` for the instant `tick + ahead`, made from samples
        that are known at `tick`. `ahead` is half a step for a plant, which holds its inputs
        over the step, and 0 for a sampled block."""
