"""Where a hold stands: what it may know besides the samples of its source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Site:
    """size entries; `seconds` turns ticks into s.

    displacement reads the target's displacement along the signal, so that
    signal . d(displacement) is the power into the target (J); its sign is in it.
    """

    size: int
    seconds: Callable[[float], float] = float
    displacement: Callable[[], Vector] | None = None
