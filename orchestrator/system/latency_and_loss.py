"""Latency (of computing or communication) and loss of samples on a connection.

A sample stamped t is known to the target from t + latency on, rounded up to a tick; one that its
source gives later than that, as in real time, from then on. Where latencies differ, samples can
overtake each other: one that arrives after a newer one is dropped. The sample of t = 0 is known at
once, so that a run starts consistently.
"""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Iterator
from fractions import Fraction
from itertools import count
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.holds import Hold
from hapticlink.orchestrator.holds.hold import Vector
from hapticlink.orchestrator.scene.scene_tables import Latency


class SampleLink:
    """The samples in transit on one connection. A latency is drawn uniformly between min and max
    (s), a loss with the given probability, both from PCG64 with the seed."""

    def __init__(self, latency: Latency, base: Fraction) -> None:
        self._low = exact(latency.min)
        self._spread = exact(latency.max) - self._low if latency.max is not None else Fraction(0)
        self._loss, self._base = latency.loss, base
        self._draw = np.random.Generator(np.random.PCG64(latency.seed)).random
        # In the order of arrival, so that equal states have equal lists, as the lifted map needs.
        self._in_transit: list[tuple[int, int, int, Any]] = []
        self._order, self._newest = count(), 0
        self.sent = self.lost = self.overtaken = 0

    def draw(self) -> int:
        """The latency of the next sample (ticks), -1 if it is lost."""
        share, luck = self._draw(), self._draw()
        if luck < self._loss:
            return -1
        return math.ceil((self._low + self._spread * Fraction(share)) / self._base)

    def send(self, stamp: int, item: Any = None, earliest: int = 0) -> None:
        """Send a sample, which arrives at `earliest` (tick) or later."""
        late = self.draw()
        self.sent += 1
        if late < 0:
            self.lost += 1
            return
        arrival = max(stamp + late, earliest)
        insort(self._in_transit, (arrival, stamp, next(self._order), item))

    def arrived(self, tick: int) -> Iterator[tuple[int, int, Any]]:
        """(arrival, stamp, item) of each sample that has arrived by `tick` since the last call."""
        while self._in_transit and self._in_transit[0][0] <= tick:
            arrival, stamp, _, item = self._in_transit.pop(0)
            if stamp < self._newest:
                self.overtaken += 1
                continue
            self._newest = stamp
            yield arrival, stamp, item


class Late(Hold):
    """A hold that receives its samples through a link."""

    def __init__(self, hold: Hold, link: SampleLink) -> None:
        self.hold, self.link = hold, link
        self._started = False

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        if self._started:
            self.link.send(stamp, sample.copy(), arrival)
        else:
            self.hold.push(stamp, sample, arrival)
            self._started = True

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        for arrival, stamp, sample in self.link.arrived(tick):
            self.hold.push(stamp, sample, arrival)
        return self.hold.value(tick, ahead)
