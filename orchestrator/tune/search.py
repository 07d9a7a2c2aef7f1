"""The search of gains: limits of stability over poses and hands, and laws that feel alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.optimize import brentq

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.tune.held import UNSTABLE, Complex, Held

HANDS = (100.0, 1000.0)
"""Stiffnesses (N/m) of the hands that a margin is for: a light touch and a firm grip."""
STRIDE, WIDEST = np.log(2.0), 20 * np.log(2.0)
"""Of the logarithm of a scale: steps on the way to a limit, and where the way ends."""
FINE, COARSE = 0.01, 0.1
"""Of the logarithm of a scale."""
RIGID = 1e7
"""Felt stiffness (N/m) above which nothing gives way: the hand's own wrench is cancelled."""
EQUAL = 0.02
"""Difference of felt stiffnesses, relative, that is equal."""
SPARE, ROUNDS = 0.05, 4
"""Of a margin, relative, that is left over; rounds of making laws alike and scaling all."""


class Search:
    """Limits of stability over the poses `at`, and stiffnesses along their wrenches."""

    def __init__(
        self, at: Mapping[str, Held], along: Mapping[str, tuple[float, ...]], hertz: float
    ) -> None:
        self._at, self._along, self._hertz = at, along, hertz
        self.laws = list(dict.fromkeys(law.name for h in at.values() for law in h.gains.laws))
        if not self.laws:
            raise InputFault("no coupling, topology controller or contact: no gains to tune")

    def alone(self, law: str) -> float:
        """The scale at which a law is unstable in a firm grip, the others as in the scene, to a
        tenth: it sets ratios alone."""
        places = [h for h in self._at.values() if any(each.name == law for each in h.gains.laws)]
        pose = places[-1] if law == "contact" else places[0]
        return _limit(lambda s: pose.growth({law: s}, HANDS[-1]), law, COARSE)

    def common(self, scales: Mapping[str, float]) -> float:
        """The factor on all scales at which the scene is unstable in the worst pose and hand."""
        limit = np.inf
        for hand in HANDS[::-1]:
            for place in self._at.values():

                def growth(factor: float, place: Held = place, hand: float = hand) -> float:
                    tried = {law: scales.get(law, 1.0) * factor for law in self.laws}
                    return place.growth(tried, hand)

                if not np.isfinite(limit) or growth(limit) > 0.0:
                    limit = _limit(growth, "all gains", FINE)
        return float(limit)

    def compliances(self, scales: Mapping[str, float]) -> dict[str, Complex]:
        """The compliance (3, 3) at the handle in each pose."""
        return {
            name: place.compliance(scales, HANDS[-1], self._hertz)
            for name, place in self._at.items()
        }

    def felt(self, scales: Mapping[str, float]) -> dict[str, float]:
        """The felt stiffness (N/m) in each pose; infinite where nothing gives way."""
        found = {}
        for name, X in self.compliances(scales).items():
            n = np.array(self._along[name])
            given_way = float(abs(n @ X @ n))
            found[name] = np.inf if given_way < 1.0 / RIGID else 1.0 / given_way
        return found

    def equal(self, scales: Mapping[str, float]) -> dict[str, float]:
        """`scales` with the law of what feels stiffer softened until both feel alike; as they are
        where that law does not make the difference."""
        felt = self.felt(scales)
        if len(felt) < 2 or not np.isfinite([*felt.values()]).all():
            return dict(scales)
        stiff = max(felt, key=lambda name: felt[name])
        soft = min(felt, key=lambda name: felt[name])
        law = {"constraint": "topology", "contact": "contact"}[stiff]
        if law not in scales or felt[stiff] <= felt[soft] * (1 + EQUAL):
            return dict(scales)

        def apart(logarithm: float) -> float:
            tried = self.felt({**scales, law: float(np.exp(logarithm))})
            return float(np.log(tried[stiff] / tried[soft]))

        top = float(np.log(scales[law]))
        bottom = top - 10.0
        if apart(bottom) > 0.0:
            return dict(scales)
        return {**scales, law: float(np.exp(brentq(apart, bottom, top, xtol=FINE)))}

    def balanced(
        self, scales: Mapping[str, float], margin: float
    ) -> tuple[dict[str, float], float]:
        """Scales that feel alike at the margin asked for, and their margin: what the softer law
        gives back of it goes to all laws."""
        for _ in range(ROUNDS):
            softened = self.equal(scales)
            reached = self.common(softened)
            if softened == scales or reached <= margin * (1 + SPARE):
                break
            scales = {law: scale * reached / margin for law, scale in softened.items()}
        return softened, reached

    def tables(self, scales: Mapping[str, float]) -> dict[str, dict[str, Any]]:
        found: dict[str, dict[str, Any]] = {}
        for place in self._at.values():
            found |= place.gains.tables(scales)
        return found


def _limit(growth: Callable[[float], float], what: str, fine: float) -> float:
    """The least scale found at which `growth` (1/s) of a scale crosses 0, its logarithm to `fine`;
    that of WIDEST where there is none."""
    known: dict[float, float] = {}

    def at(logarithm: float) -> float:
        if logarithm not in known:
            found = growth(float(np.exp(logarithm)))
            known[logarithm] = found if np.isfinite(found) else UNSTABLE
        return known[logarithm]

    low = high = 0.0
    if at(0.0) > 0.0:
        while at(low := low - STRIDE) > 0.0:
            if low < -WIDEST:
                raise InputFault(f"{what}: unstable however low the gains are")
        high = low + STRIDE
    else:
        while at(high := high + STRIDE) <= 0.0:
            if high > WIDEST:
                return float(np.exp(WIDEST))
        low = high - STRIDE
    return float(np.exp(brentq(at, low, high, xtol=fine)))
