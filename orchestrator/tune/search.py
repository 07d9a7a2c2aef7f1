"""Limits of stability over poses and hands, what is felt, and the search for a largest scale."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from scipy.optimize import brentq

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.tune.gains import Scales
from hapticlink.orchestrator.tune.held import Complex, Held, Vector

HANDS = (100.0, 1000.0)
"""Stiffnesses (N/m) of the hands that a margin is for: a light touch and a firm grip."""
FINE = 0.01
"""Of the logarithm of a scale."""
RIGID = 1e7
"""Felt stiffness (N/m) above which nothing gives way."""
DOUBLINGS = 10
"""How often a scale is doubled or halved on the way to a limit."""


class Judge:
    """Stability in the poses `at` and what is felt in one of them along unit wrenches, by name."""

    def __init__(
        self, at: Mapping[str, Held], felt_at: str, along: Mapping[str, Vector], hertz: float
    ) -> None:
        self._at, self.along, self._hertz = at, along, hertz
        self._felt_at = at[felt_at]
        self.gains = self._felt_at.gains
        self.laws = [law.name for law in self.gains.laws]
        if not self.laws:
            raise InputFault("no virtual coupling and no topology controller: no gains to tune")
        self._order = [(pose, hand) for hand in HANDS[::-1] for pose in at]

    def unstable(self, scales: Scales, factor: float) -> str | None:
        """The pose and hand in which all gains times a factor are unstable, None where they are
        stable in all. The one that was found last is judged first."""
        for place in self._order:
            if not self._stable(place, scales, factor):
                self._order.sort(key=lambda each: each != place)
                return f"the margin in the pose at {place[0]}, in a hand of {place[1]:g} N/m"
        return None

    def _stable(self, place: tuple[str, float], scales: Scales, factor: float) -> bool:
        times = {law: scales.get(law, 1.0) * factor for law in self.laws}
        return self._at[place[0]].growth(times, place[1]) <= 0.0

    def margin(self, scales: Scales, fine: float = FINE) -> float:
        """The largest factor on all gains with which no pose and hand is unstable, to `fine` of its
        logarithm."""
        found = np.inf
        for place in list(self._order):
            if found == np.inf or not self._stable(place, scales, found):
                found = largest(partial(self._stable, place, scales), fine)
        return found

    def compliance(self, scales: Scales) -> Complex:
        """The compliance (3, 3) of the handle where stiffness is felt."""
        return self._felt_at.compliance(scales, HANDS[-1], self._hertz)

    def felt(self, scales: Scales) -> dict[str, float]:
        """The felt stiffness (N/m) along each wrench; infinite where nothing gives way."""
        X = self.compliance(scales)
        gives = {name: float(abs(n @ X @ n)) for name, n in self.along.items()}
        return {name: 1.0 / x if x * RIGID > 1.0 else np.inf for name, x in gives.items()}

    def alike(self, scales: Scales) -> dict[str, float]:
        """`scales` with the topology's one with which the constraint feels like the contact.
        Raises InputFault where there is none."""

        def apart(logarithm: float) -> float:
            felt = self.felt({**scales, "topology": float(np.exp(logarithm))})
            return float(np.log(felt["constraint"] / felt["contact"]))

        end = float(np.log(scales["topology"]))
        way = -np.sign(apart(end)) * np.log(2.0)
        for _ in range(DOUBLINGS):
            start, end = end, end + way
            if apart(end) * way >= 0.0:
                root = brentq(apart, start, end, xtol=FINE)
                return {**scales, "topology": float(np.exp(root))}
        raise InputFault("no stiffness of the topology controller feels like the contact")


def largest(holds: Callable[[float], bool], fine: float) -> float:
    """The largest scale that holds on the way from 1, found by doubling or halving it and then to
    `fine` of its logarithm. Raises InputFault where none does."""
    low = high = 0.0
    if holds(1.0):
        while holds(np.exp(high := high + np.log(2.0))):
            low = high
            if low > DOUBLINGS * np.log(2.0):
                return float(np.exp(low))
    else:
        while not holds(np.exp(low := low - np.log(2.0))):
            high = low
            if low < -DOUBLINGS * np.log(2.0):
                raise InputFault(f"none holds down to {np.exp(low):.1g} times the scene's")
    while high - low > fine:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(float(np.exp(middle))) else (low, middle)
    return float(np.exp(low))
