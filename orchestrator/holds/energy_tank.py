"""Energy tank of a spring-damper whose set position is held; the equations are in
`passive_set_position`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector


@dataclass(frozen=True)
class NearEnd:
    """The near end of a spring-damper at the haptic rate.

    position, velocity: read x and v; without v it is the difference of two positions. turns: a full
    turn for each entry that is a wrapped angle, else 0. sampled: whether F is computed at each tick
    and held until the next, or acts continuously. period: T (s), the longest step.
    """

    position: Callable[[], Vector]
    turns: Vector
    period: float
    seconds: Callable[[float], float]
    velocity: Callable[[], Vector] | None = None
    sampled: bool = False


class EnergyTank:
    """Available energy of one spring-damper, shared by the holds of its set position (row 0) and
    set velocity (row 1), and by the hold of the force on its far side.

    stiffness, damping: K and B by entry. `newest` are the newest samples (2, n), `available` is A_k
    (J), `least` the smallest so far, at most 0 (1,), `needed` what of it the near side may take
    until its next tick, `withheld` the part of F that the modulation took away.
    """

    def __init__(self, stiffness: Vector, damping: Vector, near: NearEnd) -> None:
        self.stiffness, self.damping, self.near = stiffness, damping, near
        n = len(stiffness)
        self.newest, self._modulated = np.zeros((2, n)), np.zeros((2, n))
        self._x, self._force, self.withheld = np.zeros(n), np.zeros(n), np.zeros(n)
        self._tick, self.available, self.needed, self._credited = -1, 0.0, 0.0, 0.0
        self.least = np.zeros(1)

    def __deepcopy__(self, memo: dict[int, Any]) -> EnergyTank:
        """Returns the tank itself, as copied holds have to share it; whoever restores a state
        therefore restores the tank's attributes beside those of the holds."""
        return self

    def credit(self, total: float) -> None:
        """Take note of the energy (J) that the far side has put in since the start."""
        self.available += total - self._credited
        self._credited = total

    def modulated(self, tick: int) -> Vector:
        """Set position and set velocity (2, n) that apply from `tick` on, beside the near end as it
        is read; repeated calls at one tick return the same values."""
        if tick > self._tick:
            read = self.near.position().copy()
            position, velocity = self.newest
            x = _unwrapped(read, position if self._tick < 0 else self._x, self.near.turns)
            error = position - x
            stored = total(self.stiffness * (error * error)) / 2
            seconds = self.near.seconds(tick - self._tick)
            moved = x - self._x
            if self._tick < 0:
                self.available += stored
                moved = np.zeros_like(x)
            else:
                self.available += self._put_in(moved, seconds)
            self.least[0] = min(self.least[0], self.available)
            needed = stored + self.near.period / 4 * total(self.damping * (velocity * velocity))
            left = max(self.available, 0.0)
            share = 1.0 if needed <= left else math.sqrt(left / needed)
            if share == 1.0:
                self._modulated[0], self._modulated[1] = position + (read - x), velocity
            else:
                self._modulated[0], self._modulated[1] = read + share * error, share * velocity
            full = self.stiffness * error + self.damping * velocity
            v = self.near.velocity().copy() if self.near.velocity else moved / seconds
            self._force = share * full - self.damping * v
            if not self.near.sampled:
                self._force = self.stiffness * (share * error)
            self.withheld = (1.0 - share) * full
            self.needed = share * share * needed
            self._tick, self._x = tick, x
        return self._modulated

    def _put_in(self, moved: Vector, seconds: float) -> float:
        """The energy that the near side has put in over the last step; a lower bound of it where F
        acts continuously."""
        if self.near.sampled:
            return -total(self._force * moved)
        # V(x) - V(x_k) without the difference of two squares.
        spring = total(moved * (self.stiffness * moved / 2 - self._force))
        damper = total(self.damping * moved * (moved / seconds - self._modulated[1]))
        return spring + damper

    def shared(
        self, effort: Vector, predicted: Vector, furthest: Vector, trust: Vector
    ) -> tuple[Vector, float]:
        """The effort that the far side gets over its next step, and the energy (J) set aside for
        it. predicted, furthest: its displacement and the bound D of it, so that effort * predicted
        is the work that the far side gets; trust: beta."""
        withheld = trust * self.withheld
        effort = np.where(withheld * predicted < 0.0, effort + withheld, effort)
        drawn = np.where(effort * predicted > 0.0, np.abs(effort) * furthest, 0.0)
        wanted, room = total(drawn), max(self.available - self.needed, 0.0)
        if wanted > room:
            effort = np.where(drawn > 0.0, effort * (room / wanted), effort)
            wanted = room
        self.available -= wanted
        return effort, wanted


def _unwrapped(x: Vector, last: Vector, turns: Vector) -> Vector:
    """x with whole turns added, so that it lies within half a turn of `last`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(turns > 0.0, x + turns * np.round((last - x) / turns), x)


def total(terms: Vector) -> float:
    """The sum from the first to the last, each rounded; `sum` and NumPy have ways of their own."""
    total = 0.0
    for term in terms.tolist():
        total += term
    return total
