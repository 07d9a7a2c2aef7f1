"""Passivity observer: the energy that a held effort generates; base of `passive` and `nepce`.

By axis, each held force F_held paired with the displacement dx of the step that it acts over:

E(t) = sum F_held dx - sum (F_{k-1} + F_k)/2 (x(t_k) - x(t_{k-1})) - F_n (x(t) - x(t_n))

The ideal force is taken as linear in the displacement between samples (exact for a spring) and,
after the newest sample t_n, as F_n, since later samples are not known yet. A delayed sample is
paired with the target's position at its stamp, interpolated linearly between the target's steps.
Up to t_n this equals what run/energy/meter.py measures, except for samples that are lost or
overtaken, which the target never sees.
"""

from __future__ import annotations

from collections import deque
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.holds.energy_tank import EnergyTank, total
from hapticlink.orchestrator.holds.hold import Hold, HoldContext


def repayment(excess: Vector, motion: Vector, largest: Vector) -> Vector:
    """The effort that does the work -excess (J) over the displacement `motion`, by axis, limited to
    +-largest; 0 where the target does not move.

    With v = motion/T it is alpha v, alpha = -excess/(T v^2): the series passivity controller of
    Hannaford & Ryu (IEEE Trans. Robotics and Automation 18, 2002).
    """
    effort = np.zeros_like(excess)
    np.divide(-excess, motion, out=effort, where=motion != 0.0)
    return np.where(effort < -largest, -largest, np.where(effort > largest, largest, effort))


class Account(Hold):
    """Base of both holds: a zero-order hold plus `correction`, evaluated once at each tick read.

    By axis: motion, the displacement of the last step; predicted_steady and predicted, that of the
    coming step at the target's present velocity, and with the acceleration of the last step as
    well (m, rad); largest, the larger magnitude of the last two samples; swing, the running maximum
    of the difference between the source's mean over an interval between stamps and a sample held
    during it (N, N.m); beta, the trust in the prediction. premises: the steps by entry so far, how
    many of them were outside the premises of the hold, or of its tank, and the energy (J) that such
    steps can have generated beyond what is proved (`_stake`).
    """

    needs = "power"

    def __init__(self, context: HoldContext) -> None:
        assert context.displacement is not None
        self.displacement, self.velocity = context.displacement, context.velocity
        self._seconds = context.seconds
        self._new: list[tuple[int, Vector]] = []
        self._stamp, self._tick = 0, -1
        self.sample = self._held = np.zeros(context.size)
        self._x = self._x_stamp = np.zeros(context.size)
        self._path: deque[tuple[int, Vector]] = deque()  # (tick, x) since the newest stamp
        self._held_until: deque[tuple[int, Vector]] = deque()  # (tick, sample held until then)
        self._delayed = False
        self._work, self._ideal = np.zeros(context.size), np.zeros(context.size)
        self.motion = self.predicted_steady = self.predicted = np.zeros(context.size)
        self._v = self._gain = np.zeros(context.size)
        self._steps = 0
        self.largest, self.swing = np.zeros(context.size), np.zeros(context.size)
        self.beta = np.ones(context.size)
        self.tank: EnergyTank | None = None  # of a spring-damper, on whose far side it is
        self.premises = np.zeros(3)
        self._promised, self._promise = 0.0, (0.0, -1)

    def push(self, stamp: int, sample: Vector, arrival: int) -> None:
        self._new.append((stamp, sample.copy()))
        self._delayed = arrival > stamp

    def value(self, tick: int, ahead: float = 0.0) -> Vector:
        if tick > self._tick or self._new:
            fresh = bool(self._new)
            self._account(tick)
            self._predict(2 * ahead)
            self._held = self.sample + self.correction(fresh)
            if self.tank:
                self._share(self.tank, tick)
        return self._held

    def _share(self, tank: EnergyTank, tick: int) -> None:
        """Limit the held effort to the energy available in the tank, and set that aside."""
        promise, since = self._promise
        if since == tick:
            tank.available += promise
            self._promised -= promise
        furthest = np.abs(self.predicted) + np.abs(self.predicted_steady)
        self._held, promise = tank.shared(self._held, self.predicted, furthest, self.beta)
        self._promised += promise
        self._promise = promise, tick

    @property
    def credit(self) -> float:
        """The energy (J) that the far side has put in until now, with what was set aside for it."""
        work = self._work + self._held * (self.displacement() - self._x)
        return self._promised - total(work)

    @property
    def generated(self) -> Vector:
        """E(t), the energy generated until now (J), by axis."""
        return self._work - self._ideal - self.sample * (self._x - self._x_stamp)

    @property
    def travelled(self) -> Vector:
        """Distance since the stamp of the newest sample, by axis: |x - x(t_n)|, or, where samples
        are delayed and several may be in transit, the length of the path."""
        if not self._delayed:
            return np.abs(self._x - self._x_stamp)
        corners = [self._x_stamp, *(x for tick, x in self._path if tick > self._stamp)]
        length = np.zeros_like(self._x)
        for before, x in pairwise(corners):  # one after the other: NumPy's `sum` has its own order
            length += np.abs(x - before)
        return length

    def correction(self, fresh: bool) -> Vector:
        """The effort added to the newest sample until the next tick; `fresh` when that sample is
        new."""
        raise NotImplementedError

    def _account(self, tick: int) -> None:
        """Adds the held work since the last tick, and the ideal work up to each new stamp."""
        x = self.displacement().copy()
        if self._tick < 0:
            self._x = self._x_stamp = x
            self._stamp, self.sample = self._new[0]
            self._tick = tick
            self._v = self.velocity().copy() if self.velocity else self._v
        self.motion = x - self._x
        self._steps, passed, mean = tick - self._tick, self._stamp, np.zeros_like(x)
        self._work = self._work + self._held * self.motion
        if self._steps:
            self._watch()
        if not self._path or tick > self._path[-1][0]:
            self._path.append((tick, x))
        if self._new:
            self._held_until.append((tick, self.sample))
        for stamp, sample in self._new:
            x_stamp = self._position_at(stamp)
            self._ideal = self._ideal + (self.sample + sample) / 2 * (x_stamp - self._x_stamp)
            self.largest = np.maximum(np.abs(sample), np.abs(self.sample))
            mean += (self.sample + sample) / 2 * (stamp - self._stamp)
            self._stamp, self._x_stamp, self.sample = stamp, x_stamp, sample
        if self._stamp > passed:
            mean /= self._stamp - passed
            for _, held in self._held_until:
                self.swing = np.maximum(self.swing, np.abs(mean - held))
            while self._held_until and (self._held_until[0][0] <= self._stamp or not self._delayed):
                self._held_until.popleft()
        self._new.clear()
        self._tick, self._x = tick, x

    def _watch(self) -> None:
        """Counts the entries of the step that has ended, and what is at stake in it."""
        outside, stake = self._stake()
        for i in range(len(stake)):
            self.premises += 1.0, outside[i], stake[i]

    def _stake(self) -> tuple[NDArray[np.bool_], Vector]:
        """Which entries of the last step were outside the premises, and the energy (J) that it can
        have generated by that: with a tank the work beyond what was set aside for it."""
        furthest = np.abs(self.predicted) + np.abs(self.predicted_steady)
        if not self.tank:
            return self.outside(furthest, np.abs(self._held - self.sample))
        aside = np.where(self._held * self.predicted > 0.0, np.abs(self._held) * furthest, 0.0)
        beyond = self._held * self.motion - aside
        return beyond > 0.0, np.where(beyond > 0.0, beyond, 0.0)

    def outside(self, furthest: Vector, added: Vector) -> tuple[NDArray[np.bool_], Vector]:
        """The same by the hold's own premises; added: the size of the correction that was held."""
        raise NotImplementedError

    def _position_at(self, stamp: int) -> Vector:
        """The target's position at `stamp`, interpolated linearly; drops the path before it, since
        stamps never decrease."""
        path = self._path
        while len(path) > 1 and path[1][0] <= stamp:
            path.popleft()
        (tick, x), (later, x_later) = path[0], path[min(1, len(path) - 1)]
        if stamp <= tick or later == tick:
            return x
        return x + (x_later - x) * ((stamp - tick) / (later - tick))

    def _predict(self, step: float) -> None:
        """Predicts the displacement of the coming step, of `step` ticks or the length of the last
        one if that is longer. Without a velocity output, the last displacement is repeated."""
        if self.velocity is None:
            self.predicted_steady = self.predicted = self.motion
            return
        v, step = self.velocity().copy(), max(step, self._steps)
        if self._steps:
            self._gain = (v - self._v) / self._steps
        self._v = v
        self.predicted_steady = v * self._seconds(step)
        self.predicted = self.predicted_steady + self._gain * (step / 2 * self._seconds(step))
