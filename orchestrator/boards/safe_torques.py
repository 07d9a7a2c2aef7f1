"""What may be sent to motors that somebody holds, whatever a scene asks for."""

from __future__ import annotations

import math
from collections.abc import Sequence


class SafeTorques:
    """Torques within the limits of a [device.driver].

    The magnitude of each is at most `most` (N.m); it grows by at most `rate` (N.m/s), and falls as
    it is asked for. All are scaled by one factor, so that the wrench keeps its direction.
    """

    def __init__(self, most: float, rate: float, motors: int) -> None:
        self._most, self._rate, self._none = most, rate, [0.0] * motors
        self.sent = self._none
        """The torques (N.m) that were sent last."""

    def limit(self, torques: Sequence[float], step: float) -> list[float]:
        """What to send a time `step` (s) after the torques before, of the `torques` (N.m) asked
        for. Raises ValueError where one is not finite."""
        if not all(map(math.isfinite, torques)):  # min and max let a NaN become the limit
            raise ValueError(f"torques are {[*torques]}: not finite")
        factor = 1.0
        for asked, before in zip(torques, self.sent, strict=True):
            grown = abs(before) if asked * before > 0.0 else 0.0
            most = min(self._most, grown + self._rate * step)
            if abs(asked) > most:
                factor = min(factor, most / abs(asked))
        self.sent = [factor * asked for asked in torques]
        return self.sent

    def rest(self) -> list[float]:
        """No torque."""
        self.sent = self._none
        return self.sent
