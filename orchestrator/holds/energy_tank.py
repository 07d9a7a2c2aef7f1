"""Energy tank of a spring-damper whose set position is held; the equations are in
`passive_set_position`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.restorable import Restorable

Vector = NDArray[np.float64]


class EnergyTank(Restorable):
    """Available energy of one spring-damper, shared by the holds of its set position (row 0) and
    set velocity (row 1).

    stiffness, damping: K and B by entry. position: reads x. period: T (s), the longest step.
    `newest` are the newest samples (2, n), `available` is A_k (J).
    """

    def __init__(
        self,
        stiffness: Vector,
        damping: Vector,
        position: Callable[[], Vector],
        period: float,
        seconds: Callable[[float], float],
    ) -> None:
        self.stiffness, self.damping = stiffness, damping
        self.position, self.period, self._seconds = position, period, seconds
        self.newest = np.zeros((2, len(stiffness)))
        self._modulated = self.newest.copy()
        self._x = np.zeros(len(stiffness))
        self._tick, self.available = -1, 0.0

    def __deepcopy__(self, memo: dict[int, Any]) -> EnergyTank:
        """Returns the tank itself, as copied holds have to share it; a rollback therefore saves
        and restores the tank's attributes beside those of the holds."""
        return self

    def modulated(self, tick: int) -> Vector:
        """Set position and set velocity (2, n) that apply from `tick` on; repeated calls at one
        tick return the same values."""
        if tick > self._tick:
            x = self.position().copy()
            position, velocity = self.newest
            error = position - x
            stored = _sum(self.stiffness * (error * error)) / 2
            if self._tick < 0:
                self.available = stored
            else:
                self._update(x, self._seconds(tick - self._tick))
            needed = stored + self.period / 4 * _sum(self.damping * (velocity * velocity))
            left = max(self.available, 0.0)
            if needed <= left:
                self._modulated[:] = self.newest
            else:
                share = math.sqrt(left / needed)
                self._modulated[0], self._modulated[1] = x + share * error, share * velocity
            self._tick, self._x = tick, x
        return self._modulated

    def _update(self, x: Vector, seconds: float) -> None:
        """Adds the energy that the local side put in over the last step, A_{k+1} - A_k."""
        position, velocity = self._modulated
        moved = x - self._x
        # V(x) - V(x_k) without the difference of two squares.
        spring = _sum(self.stiffness * moved * (self._x + moved / 2 - position))
        damper = _sum(self.damping * moved * (moved / seconds - velocity))
        self.available += spring + damper


def _sum(terms: Vector) -> float:
    """The sum from the first to the last, each rounded; `sum` and NumPy have ways of their own."""
    total = 0.0
    for term in terms.tolist():
        total += term
    return total
