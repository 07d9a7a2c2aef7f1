"""Delayed interpolation: when sample n arrives, from y_{n-1} to y_n in H = t_n - t_{n-1}.

y_{n-1} + (y_n - y_{n-1}) min(1, s/H), with s the time since the arrival. Continuous, never beyond
a sample, and late by H: order 1.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.history import History
from hapticlink.orchestrator.holds.site import Site


class Delayed:
    needs: ClassVar[str | None] = None
    gives_samples: ClassVar[bool] = False
    degree: ClassVar[int] = 1

    def __init__(self, site: Site) -> None:
        self._samples = History(2)
        self._arrival = 0

    def push(self, stamp: int, sample: NDArray[np.float64], arrival: int) -> None:
        self._samples.push(stamp, sample)
        self._arrival = arrival

    def value(self, tick: int, ahead: float = 0.0) -> NDArray[np.float64]:
        (before, first), (stamp, newest) = self._samples[0], self._samples[-1]
        share = (tick - self._arrival + ahead) / (stamp - before) if stamp > before else 1.0
        return first + (newest - first) * min(1.0, share)
