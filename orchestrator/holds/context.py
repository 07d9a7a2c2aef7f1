"""Where a hold stands: what it may know besides the samples of its source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from hapticlink.orchestrator.holds.energy_tank import EnergyTank

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class HoldContext:
    """size entries; `seconds` turns ticks into s.

    displacement reads the target's displacement along the signal, so that
    signal . d(displacement) is the power into the target (J); its sign is in it. velocity reads
    its derivative, where the target puts it out. tank is
    the spring that the signal sets, with 0 for its set position, 1 for its set velocity.
    """

    size: int
    seconds: Callable[[float], float] = float
    displacement: Callable[[], Vector] | None = None
    velocity: Callable[[], Vector] | None = None
    tank: tuple[EnergyTank, int] | None = None
