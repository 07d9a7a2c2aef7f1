"""The energy that a held effort generates, kept while it is held; `passive` and `nepce` act on it.

By axis, each held force paired with the displacement that follows it:

made(t) = sum F_held dx - sum (F_{k-1} + F_k)/2 (x(t_k) - x(t_{k-1})) - F_n (x(t) - x(t_n))

The ideal source is straight in the displacement between samples, which is exact for a spring;
what it does after the newest sample, t_n, is not known yet and taken as F_n's work. A sample that
comes late is booked where the target stood at its stamp, x being straight between the target's
steps: what `energy` measures, up to t_n. The part of a sample that is lost or overtaken nobody
knows here.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.context import HoldContext
from hapticlink.orchestrator.holds.hold import Hold

Vector = NDArray[np.float64]


def repayment(excess: Vector, motion: Vector, largest: Vector) -> Vector:
    """The effort whose work on `motion` takes `excess` (J) away, each entry within +-largest.

    With v = motion/T it is alpha v, alpha = -excess/(T v^2): the series passivity controller of
    Hannaford & Ryu (IEEE Trans. Robotics and Automation 18, 2002).
    """
    effort = np.zeros_like(excess)
    np.divide(-excess, motion, out=effort, where=motion != 0.0)
    return np.clip(effort, -largest, largest)


class Account(Hold):
    """The base of both holds: zero order, plus `correction` once for every tick that is asked for.

    motion: the last displacement. straight, ahead: that of the step to come with the target's
    velocity as it is, and as it has changed over the last step. largest of the last two samples;
    swing, the most by which the mean of the source over samples that came together ever left one
    that was the newest known while it acted.
    """

    needs = "power"

    def __init__(self, context: HoldContext) -> None:
        assert context.displacement is not None
        self._displacement, self._velocity = context.displacement, context.velocity
        self._seconds = context.seconds
        self._new: list[tuple[int, Vector]] = []
        self._stamp, self._tick = 0, -1
        self.sample = self._held = np.zeros(context.size)
        self._x = self._x_stamp = np.zeros(context.size)
        self._path: deque[tuple[int, Vector]] = deque()  # from the newest stamp on
        self._acted: deque[tuple[int, Vector]] = deque()  # until when a sample was the newest
        self._late = False
        self._work, self._ideal = np.zeros(context.size), np.zeros(context.size)
        self.motion = self.straight = self.ahead = np.zeros(context.size)
        self._v = self._gain = np.zeros(context.size)
        self._steps = 0
        self.largest, self.swing = np.zeros(context.size), np.zeros(context.size)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self._new.append((stamp, sample.copy()))
        self._late = arrival > stamp

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        if tick > self._tick or self._new:
            fresh = bool(self._new)
            self._book(tick)
            self._look(2 * ahead)
            self._held = self.sample + self.correction(fresh)
        return self._held

    @property
    def made(self) -> Vector:
        """J by axis, until now."""
        return self._work - self._ideal - self.sample * (self._x - self._x_stamp)

    @property
    def travelled(self) -> Vector:
        """Since the newest sample: the displacement, or where samples come late, so that several
        may be under way, all of the path."""
        if not self._late:
            return np.abs(self._x - self._x_stamp)
        corners = np.array([self._x_stamp, *(x for tick, x in self._path if tick > self._stamp)])
        return np.abs(np.diff(corners, axis=0)).sum(axis=0)

    def correction(self, fresh: bool) -> Vector:
        """What is added to the newest sample until the next tick; `fresh` with a new one."""
        raise NotImplementedError

    def _book(self, tick: int) -> None:
        """The motion since the last tick, and of each new sample the ideal up to its stamp."""
        x = self._displacement().copy()
        if self._tick < 0:
            self._x = self._x_stamp = x
            self._stamp, self.sample = self._new[0]
            self._tick = tick
            self._v = self._velocity().copy() if self._velocity else self._v
        self.motion = x - self._x
        self._steps, passed, mean = tick - self._tick, self._stamp, np.zeros_like(x)
        self._work = self._work + self._held * self.motion
        if not self._path or tick > self._path[-1][0]:
            self._path.append((tick, x))
        if self._new:
            self._acted.append((tick, self.sample))
        for stamp, sample in self._new:
            there = self._at(stamp)
            self._ideal = self._ideal + (self.sample + sample) / 2 * (there - self._x_stamp)
            self.largest = np.maximum(np.abs(sample), np.abs(self.sample))
            mean += (self.sample + sample) / 2 * (stamp - self._stamp)
            self._stamp, self._x_stamp, self.sample = stamp, there, sample
        if self._stamp > passed:
            mean /= self._stamp - passed
            for _, known in self._acted:
                self.swing = np.maximum(self.swing, np.abs(mean - known))
            while self._acted and (self._acted[0][0] <= self._stamp or not self._late):
                self._acted.popleft()
        self._new.clear()
        self._tick, self._x = tick, x

    def _at(self, stamp: int) -> Vector:
        """Where the target stood; stamps never fall, so what lies before this one is forgotten."""
        path = self._path
        while len(path) > 1 and path[1][0] <= stamp:
            path.popleft()
        (tick, x), (later, there) = path[0], path[min(1, len(path) - 1)]
        if stamp <= tick or later == tick:
            return x
        return x + (there - x) * ((stamp - tick) / (later - tick))

    def _look(self, step: float) -> None:
        """Into the step to come, of `step` ticks and at least as long as the last."""
        if self._velocity is None:
            self.straight = self.ahead = self.motion
            return
        v, step = self._velocity().copy(), max(step, self._steps)
        if self._steps:
            self._gain = (v - self._v) / self._steps
        self._v = v
        self.straight = v * self._seconds(step)
        self.ahead = self.straight + self._gain * (step / 2 * self._seconds(step))
