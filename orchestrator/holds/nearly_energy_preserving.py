"""Nearly energy-preserving hold: zero-order, and the energy error of the past period, either way,
is given back over the next.

F_held = F_n - made/D with D the displacement over the last period, by axis, and never
more than the larger of the two. On a steady motion it is the half-step lead, F_n + (F_n -
F_{n-1})/2. After the nearly energy-preserving coupling element of Benedikt, Watzenig, Zehetner &
Hofer (5th Int. Conf. on Computational Methods for Coupled Problems, 2013).
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.energy_account import Account, Vector, repayment


class NearlyEnergyPreserving(Account):
    def __init__(self, context: HoldContext) -> None:
        super().__init__(context)
        self._last = self._x
        self._given = self._last * 0.0

    def correction(self, fresh: bool) -> Vector:
        if fresh:
            travelled, self._last = self._x - self._last, self._x
            self._given = repayment(self.made, travelled, self.largest)
        return self._given
