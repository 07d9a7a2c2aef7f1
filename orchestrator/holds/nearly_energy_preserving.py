"""Nearly energy-preserving hold: a zero-order hold that returns the energy error accumulated so
far, of either sign, over the next period.

F_held = F_n - E/D by axis, with E the energy generated (`energy_account`) and D the displacement
over the last period; the correction is limited to the larger magnitude of the last two samples.
On a steady motion it is the half-step lead, F_n + (F_n - F_{n-1})/2. After the nearly
energy-preserving coupling element of Benedikt, Watzenig, Zehetner & Hofer (5th Int. Conf. on
Computational Methods for Coupled Problems, 2013).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.energy_account import Account, Vector, repayment
from hapticlink.orchestrator.holds.hold import HoldContext


class NearlyEnergyPreserving(Account):
    def __init__(self, context: HoldContext) -> None:
        super().__init__(context)
        self._last = self._x
        self._correction = self._travelled = self._last * 0.0

    def outside(self, furthest: Vector, added: Vector) -> tuple[NDArray[np.bool_], Vector]:
        """A step against the motion of the last period, in which the correction does the opposite
        work."""
        beyond = (self.motion * self._travelled < 0.0) & (added > 0.0)
        return beyond, np.where(beyond, added * np.abs(self.motion), 0.0)

    def correction(self, fresh: bool) -> Vector:
        if fresh:
            self._travelled, self._last = self._x - self._last, self._x
            self._correction = repayment(self.generated, self._travelled, self.largest)
        return self._correction
