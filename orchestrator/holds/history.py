"""The newest samples of a source, with their stamps."""

from __future__ import annotations

from collections import deque
from typing import ClassVar

import numpy as np

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.hold import Hold, Vector


class History:
    """At most `depth` samples, oldest first; a second sample with the same stamp replaces the
    first."""

    def __init__(self, depth: int) -> None:
        self._samples: deque[tuple[int, Vector]] = deque(maxlen=depth)

    def push(self, stamp: int, sample: Vector) -> None:
        if self._samples and self._samples[-1][0] == stamp:
            self._samples.pop()
        self._samples.append((stamp, sample.copy()))

    def __len__(self) -> int:
        return len(self._samples)

    def __getitem__(self, index: int) -> tuple[int, Vector]:
        return self._samples[index]

    def slope(self, index: int = -1) -> Vector:
        """The backward difference quotient at a sample, per tick; 0 for the oldest sample."""
        if len(self) + index < 1:
            return np.zeros_like(self[index][1])
        (before, first), (stamp, sample) = self[index - 1], self[index]
        return (sample - first) / (stamp - before)


class OfSamples(Hold):
    """Base of holds whose value follows from the newest `depth` samples alone."""

    depth: ClassVar[int] = 2

    def __init__(self, context: HoldContext) -> None:
        self._size, self._seconds = context.size, context.seconds
        self._samples = History(self.depth)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self._samples.push(stamp, sample)
