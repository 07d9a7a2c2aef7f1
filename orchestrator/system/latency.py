"""Samples on their way: a latency (computing, communication) and losses on a connection.

A sample stamped t is known to the target from t + latency on, rounded up to a tick. Where
latencies differ samples overtake each other: the newest stamp wins, and one that comes later
than a newer one is dropped. The sample of t = 0 is known at once: a run starts in agreement.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from fractions import Fraction
from itertools import count
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.holds import Hold
from hapticlink.orchestrator.holds.hold import Vector
from hapticlink.orchestrator.scene.records import Latency


class Link:
    """The samples under way on one connection."""

    def __init__(self, latency: Latency, base: Fraction) -> None:
        self._low = exact(latency.min)
        self._spread = exact(latency.max) - self._low if latency.max is not None else Fraction(0)
        self._loss, self._base = latency.loss, base
        self._draw = np.random.Generator(np.random.PCG64(latency.seed)).random
        self._under_way: list[tuple[int, int, int, Any]] = []
        self._order, self._newest = count(), 0
        self.sent = self.lost = self.overtaken = 0

    def send(self, stamp: int, item: Any = None) -> None:
        share, luck = self._draw(), self._draw()
        self.sent += 1
        if luck < self._loss:
            self.lost += 1
            return
        late = math.ceil((self._low + self._spread * Fraction(share)) / self._base)
        heapq.heappush(self._under_way, (stamp + late, stamp, next(self._order), item))

    def arrived(self, tick: int) -> Iterator[tuple[int, int, Any]]:
        """(arrival, stamp, item) of what is known at `tick` and was not before."""
        while self._under_way and self._under_way[0][0] <= tick:
            arrival, stamp, _, item = heapq.heappop(self._under_way)
            if stamp < self._newest:
                self.overtaken += 1
                continue
            self._newest = stamp
            yield arrival, stamp, item


class Late(Hold):
    """A hold at the far end of a link."""

    def __init__(self, hold: Hold, link: Link) -> None:
        self._hold, self.link = hold, link
        self._started = False

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        if self._started:
            self.link.send(stamp, sample.copy())
        else:
            self._hold.push(stamp, sample, arrival)
            self._started = True

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        for arrival, stamp, sample in self.link.arrived(tick):
            self._hold.push(stamp, sample, arrival)
        return self._hold.value(tick, ahead)
