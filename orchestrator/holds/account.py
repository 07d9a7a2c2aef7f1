"""The energy that a held effort makes, kept while it is held; `passive` and `nepce` act on it.

By axis, each held force paired with the displacement that follows it:

made(t) = sum F_held dx - sum (F_{k-1} + F_k)/2 (x(t_k) - x(t_{k-1})) - F_n (x(t) - x(t_n))

The ideal source is straight in the displacement between samples, which is exact for a spring;
what it does after the newest sample, t_n, is not known yet and taken as F_n's work.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.holds.site import Site

Vector = NDArray[np.float64]


def repayment(excess: Vector, motion: Vector, largest: Vector) -> Vector:
    """The effort whose work on `motion` takes `excess` (J) away, each entry within +-largest.

    With v = motion/T it is alpha v, alpha = -excess/(T v^2): the series passivity controller of
    Hannaford & Ryu (IEEE Trans. Robotics and Automation 18, 2002).
    """
    effort = np.zeros_like(excess)
    np.divide(-excess, motion, out=effort, where=motion != 0.0)
    return np.clip(effort, -largest, largest)


class Account:
    """The base of both holds: zero order, plus `correction` once for every tick that is asked for.

    motion: the last displacement. straight, ahead: that of the step to come with the target's
    velocity as it is, and as it has changed over the last step. largest of the last two samples;
    swing, the most by which the mean of the source between two bookings ever left the sample held.
    """

    needs: ClassVar[str | None] = "power"
    gives_samples: ClassVar[bool] = False
    degree: ClassVar[int] = 0

    def __init__(self, site: Site) -> None:
        assert site.displacement is not None
        self._displacement, self._velocity = site.displacement, site.velocity
        self._seconds = site.seconds
        self._new: list[tuple[int, Vector]] = []
        self._stamp, self._tick = 0, -1
        self.sample = self._held = np.zeros(site.size)
        self._x = self._x_stamp = np.zeros(site.size)
        self._work, self._ideal = np.zeros(site.size), np.zeros(site.size)
        self.motion = self.straight = self.ahead = np.zeros(site.size)
        self._v = self._gain = np.zeros(site.size)
        self._steps = 0
        self.largest, self.swing = np.zeros(site.size), np.zeros(site.size)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self._new.append((stamp, sample.copy()))

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
        """The displacement since the newest sample."""
        return self._x - self._x_stamp

    def correction(self, fresh: bool) -> Vector:
        """What is added to the newest sample until the next tick; `fresh` with a new one."""
        raise NotImplementedError

    def _book(self, tick: int) -> None:
        """The motion since the last tick, split where samples were taken on the way."""
        x = self._displacement().copy()
        if self._tick < 0:
            self._x = self._x_stamp = x
            self._stamp, self.sample = self._new[0]
            self._tick = tick
            self._v = self._velocity().copy() if self._velocity else self._v
        self.motion, start, done = x - self._x, self._x, 0.0
        self._steps, passed, mean = tick - self._tick, self._stamp, np.zeros_like(x)
        first = self.sample
        self._work = self._work + self._held * self.motion
        for stamp, sample in self._new:
            if tick > self._tick:
                done = min(max((stamp - self._tick) / (tick - self._tick), 0.0), 1.0)
            there = start + self.motion * done
            self._ideal = self._ideal + (self.sample + sample) / 2 * (there - self._x_stamp)
            self.largest = np.maximum(np.abs(sample), np.abs(self.sample))
            mean += (self.sample + sample) / 2 * (stamp - self._stamp)
            self._stamp, self._x_stamp, self.sample = stamp, there, sample
        if self._stamp > passed:
            self.swing = np.maximum(self.swing, np.abs(mean / (self._stamp - passed) - first))
        self._new.clear()
        self._tick, self._x = tick, x

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
