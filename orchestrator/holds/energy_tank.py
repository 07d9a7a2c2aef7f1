"""The energy that a spring-damper set by held samples has at hand; the law is in
`passive_set_position`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


class EnergyTank:
    """The account of one spring-damper, shared by the holds of its set position (row 0) and set
    velocity (row 1). stiffness and damping by entry, `position` reads x, `period` is T (s)."""

    def __init__(
        self,
        stiffness: Vector,
        damping: Vector,
        position: Callable[[], Vector],
        period: float,
        seconds: Callable[[float], float],
    ) -> None:
        self._stiffness, self._damping = stiffness, damping
        self._position, self._period, self._seconds = position, period, seconds
        self.newest = np.zeros((2, len(stiffness)))
        self._given = self.newest.copy()
        self._x = np.zeros(len(stiffness))
        self._tick, self.available = -1, 0.0

    def __deepcopy__(self, memo: dict[int, Any]) -> EnergyTank:
        """Itself, since holds share it: who takes steps back keeps its `vars` beside theirs."""
        return self

    def given(self, tick: int) -> Vector:
        """Set position and set velocity that stand from `tick` on, the same all through it."""
        if tick > self._tick:
            x = self._position().copy()
            position, velocity = self.newest
            error = position - x
            stored = float(self._stiffness @ error**2) / 2
            if self._tick < 0:
                self.available = stored
            else:
                self._take_in(x, self._seconds(tick - self._tick))
            needed = stored + self._period / 4 * float(self._damping @ velocity**2)
            if needed <= self.available:
                self._given[:] = self.newest
            else:
                share = math.sqrt(max(self.available, 0.0) / needed)
                self._given[0], self._given[1] = x + share * error, share * velocity
            self._tick, self._x = tick, x
        return self._given

    def _take_in(self, x: Vector, seconds: float) -> None:
        position, velocity = self._given
        moved = x - self._x
        # V(x) - V(x_k) without the difference of two squares.
        spring = float((self._stiffness * moved) @ (self._x + moved / 2 - position))
        damper = float((self._damping * moved) @ (moved / seconds - velocity))
        self.available += spring + damper
