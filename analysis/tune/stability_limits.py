"""Limits of stability over poses and hands."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from hapticlink.analysis.search.search import FINE, largest_scale
from hapticlink.analysis.search.settings import Scales
from hapticlink.analysis.stability.hands import SPRINGS
from hapticlink.analysis.stability.resting_scene import RestingScene
from hapticlink.orchestrator.base.errors import InputFault


class Judge:
    """Stability in poses, by name. Raises InputFault for a scene without gains."""

    def __init__(self, at: Mapping[str, RestingScene]) -> None:
        self._at = at
        self.laws = next(iter(at.values())).gains.laws
        if not self.laws:
            raise InputFault(
                "no virtual coupling and no topology controller: no gains to tune; take "
                "--set controller.teleoperation=true"
            )
        self._order = [(pose, hand) for hand in SPRINGS[::-1] for pose in at]

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
        return self._at[place[0]].stable(times, place[1])

    def margin(self, scales: Scales, fine: float = FINE) -> float:
        """The largest factor on all gains with which no pose and hand is unstable, to `fine` of its
        logarithm. Raises InputFault where there is none."""
        found = np.inf
        for place in list(self._order):
            if found == np.inf or not self._stable(place, scales, found):
                found = largest_scale(partial(self._stable, place, scales), fine).value
                if not found:
                    raise InputFault(
                        f"unstable with any gains in the pose at {place[0]}, in a hand of "
                        f"{place[1]:g} N/m: take a higher graphics.rate or haptics.rate, more "
                        "damping of the controller, or a shorter duration, which does not come "
                        "there"
                    )
        return found
