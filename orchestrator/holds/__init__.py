"""What stands on an input between two samples of its source. One hold a file.

Stamps are ticks of the plan's base: `push` gets each sample with the tick it is true at,
`value` is asked at ticks at or after the newest stamp.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.zero_order import ZeroOrder

Vector = NDArray[np.float64]


class Hold(Protocol):
    def __init__(self, size: int) -> None: ...

    def push(self, stamp: int, sample: Vector) -> None:
        """Take a sample of the source; `sample` is only valid during the call."""

    def value(self, tick: int) -> Vector:
        """What the target reads at `tick`."""


HOLDS: dict[str, type[Hold]] = {"zoh": ZeroOrder}
