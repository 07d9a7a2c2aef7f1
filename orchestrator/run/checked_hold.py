"""Holds of plugins, whose values are checked: those of the package have tests instead."""

from __future__ import annotations

import numpy as np

from hapticlink.orchestrator.base.faults import Fault, shortened
from hapticlink.orchestrator.holds.hold import Hold, Vector


class CheckedHold(Hold):
    """Wraps a hold: a value that is no vector of `size` finite numbers is a Fault, which names the
    hold and its connection."""

    def __init__(self, hold: Hold, size: int, name: str, connection: str) -> None:
        self._hold, self._size = hold, size
        self._name, self._connection = name, connection

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self._hold.push(stamp, sample, arrival)

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        value = self._hold.value(tick, ahead)
        if (
            not isinstance(value, np.ndarray)
            or value.shape != (self._size,)
            or value.dtype.kind not in "fiu"
            or not np.isfinite(value).all()
        ):
            raise Fault(
                f"hold {self._name!r} of {self._connection}: its value is "
                f"{shortened(' '.join(repr(value).split()))}, where {self._size} finite numbers in "
                "a NumPy array are needed"
            )
        return value
