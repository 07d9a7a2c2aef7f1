"""Limit cycles of a sampled wall by the counts of its encoder and dry friction, by exact switching.

A device of mass m (kg), damping b (N.s/m) and Coulomb friction f_c (N) rests where its hand leads
it: at an edge between two counts, of which one is too little force and the other too much, each by
K quantum/2 (halfway is the worst place). There the wall is a relay, whose sampling and delay bring
energy in, and friction takes energy out.

A symmetric cycle of 2 M periods T, x(t + M T) = -x(t) about the edge, passes it between two
samples; from the sample that sees this, k = 0, and `periods` late, the wall's force is

    u_k = K quantum/2 + (B quantum/T at k = 0)

until the half cycle ends. Friction acts against v, which turns once in it, at a time tau. For a
given tau all forces are known, so that the state at k = 0 follows from a linear equation, and tau
from v(tau) = 0. Then it is checked that the samples are on the side that was assumed, that v
has the sign of its half and that only the two counts are read.

The shortest cycle, M = 1, has the force K quantum/2 + B quantum/T all the time. It exists if that
is more than f_c; if not, no force of the wall ever moves a device that rests. So K <= 2
(f_c/quantum - B/T) is the limit without cycles; with B = 0 it is that of counts in Abbott, Okamura
(2005) and Diolaiti et al. (2006) (`wall_limits.limit_with_quantum`).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

LONGEST = 1024
"""Periods for which a device is pushed back in the longest cycle that is looked for."""
TURNS = 12
"""Intervals of half a cycle in which a turn is looked for."""


class LimitCycle(NamedTuple):
    """Its frequency (Hz), and its amplitude (m): half of what the device moves."""

    frequency: float
    amplitude: float


class CountedWall(NamedTuple):
    """A device and its wall, in SI units; friction: f_c."""

    m: float
    b: float
    T: float
    K: float
    quantum: float
    friction: float = 0.0
    B: float = 0.0
    periods: int = 0

    @property
    def quiet(self) -> float:
        """The largest K (N/m) without cycles."""
        return max(0.0, 2.0 * (self.friction / self.quantum - self.B / self.T))

    def cycles(self) -> list[LimitCycle]:
        """The symmetric cycles between two counts, the longest one last; empty where that may be
        longer than LONGEST allows.

        From its turn on the device is pushed back by K quantum/2 - f_c at least, over a way of less
        than 2 quantum; on the way there friction helps, and the delay does not.
        """
        if self.quiet >= self.K:
            return []
        back, push = 1, self.K * self.quantum / 2 - self.friction
        while push > 0.0 and self._fall(back * self.T) * push < 2 * self.quantum:
            back += 1
            if back > LONGEST:
                return []
        lengths = range(1, 2 * back + self.periods + 2)
        return [cycle for M in lengths for cycle in self._of_length(M)]

    def _of_length(self, M: int) -> list[LimitCycle]:
        """The cycles of 2 M periods."""
        places = np.linspace(1e-9, 1 - 1e-9, TURNS + 1) * M * self.T
        speeds = [self._turn(M, tau) for tau in places]
        found = []
        for (low, high), (before, after) in zip(pairwise(places), pairwise(speeds), strict=True):
            if before > 0.0 >= after:
                tau = brentq(lambda tau: self._turn(M, tau), low, high, xtol=1e-15)
                found += self._checked(M, float(tau))
        return found

    def _turn(self, M: int, tau: float) -> float:
        """v(tau) of the cycle with a turn at tau."""
        x, v = self._start(M, tau)
        return next(v for t, _, v in self._half(M, tau, x, v) if t >= tau)

    def _start(self, M: int, tau: float) -> tuple[float, float]:
        """x and v at k = 0: half a cycle leads to their opposites."""
        (*_, (_, x, v)) = self._half(M, tau, 0.0, 0.0)
        decay, slide = self._free(M * self.T)
        v0 = -v / (1.0 + decay)
        return -(x + slide * v0) / 2.0, v0

    def _free(self, h: float) -> tuple[float, float]:
        """exp(-b h/m), and the way per velocity of a device without force over h (s)."""
        y = self.b * h / self.m
        return math.exp(-y), h * (-math.expm1(-y) / y if y else 1.0)

    def _fall(self, h: float) -> float:
        """The way per force from rest, (h - slide)/b, without a difference of equal numbers."""
        y = self.b * h / self.m
        if y < 1e-4:
            return h * h / self.m * (0.5 - y / 6 + y * y / 24)
        return (h - self._free(h)[1]) / self.b

    def _half(
        self, M: int, tau: float, x: float, v: float, samples: range = range(0)
    ) -> list[tuple[float, float, float]]:
        """Times, x and v of half a cycle where a force changes, and at samples, from those at 0."""
        half, kick = self.K * self.quantum / 2, self.B * self.quantum / self.T
        found, t = [(0.0, x, v)], 0.0
        first = self.periods % M
        ticks = {first, first + 1, M, *samples} - {0}
        for until in sorted({*(k * self.T for k in ticks), tau}):
            k = int((t + until) / (2 * self.T)) - self.periods  # of the sample that acts
            sign = (-1.0) ** (k // M)
            u = sign * (half + kick * (k % M == 0))
            push = -u - math.copysign(self.friction, tau - t - 1e-15)
            h = until - t
            decay, slide = self._free(h)
            x, v = x + slide * v + self._fall(h) * push, decay * v + slide / self.m * push
            t = until
            found.append((t, x, v))
        return found

    def _checked(self, M: int, tau: float) -> list[LimitCycle]:
        """The cycle with a turn at tau, if it is one."""
        path = self._half(M, tau, *self._start(M, tau), range(M))
        small = 1e-9 * self.quantum
        sampled = [x for t, x, _ in path[:-1] if abs(t / self.T - round(t / self.T)) < 1e-9]
        fits = min(sampled) > -small and path[0][1] > small
        forward = all(v > 0.0 for t, _, v in path if t < tau - 1e-15)
        back = all(v < 0.0 for t, _, v in path if t > tau + 1e-15)
        amplitude = max(x for _, x, _ in path)
        if not (fits and forward and back) or max(sampled) >= self.quantum:
            return []
        return [LimitCycle(1.0 / (2 * M * self.T), amplitude)]
