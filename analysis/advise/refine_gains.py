"""Gains of the virtual coupling beside the sets: stiffness and damping of a method scaled apart.

Gains are on a grid of NOTCH: (1, -2) is the stiffness times NOTCH and the damping by NOTCH^2. Those
are never taken that break a limit in a draw in which the set keeps all. Of the others those cost
less that break one in fewer draws, then those with the smaller error in three quarters of the
draws: the upper quartile of log(error/error of the set).

What keeps the limits narrowly in the draws of a search may break them in others. So from the set to
the gains that were found those farthest are taken, by bisection, that cost less than the set on
draws kept apart, too. What they are worth is told of draws that took no part in this.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hapticlink.analysis.advise.method import Measured, Method
from hapticlink.analysis.search.search import Point, descend, largest_count
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.scene import Scene

NOTCH = 2.0**0.25
STEPS = (4, 2, 1)
FARTHEST = 16
"""Notches of a step, and those from the set at most: a factor of 16."""
WORTH = 0.02
"""Of log(error), by which a step must lower the upper quartile."""
Draws = Sequence[Sequence[str]]
"""The options of each."""
Judge = Callable[[Sequence[Method], Draws], Sequence[Measured]]
LEAST = 1e-9
"""Errors (mm) below this count as this, and those above its inverse as that."""
NEVER = (10**9, 0.0)
"""The cost of gains that are not taken."""


@dataclass(frozen=True)
class Refined:
    """A method `found` around a `start`, both on the draws of the search, and on those that took
    `no_part` in the choice; found is start where the search found none that holds on the draws kept
    apart. tried: gains on the way."""

    start: Measured
    found: Measured
    no_part: tuple[Measured, Measured] | None
    tried: int

    @property
    def line(self) -> str:
        """What refining is worth."""
        if self.no_part is None:
            return (
                f"gains: {self.tried} others were tried; none was found to be better in three "
                "quarters of these draws and of as many others"
            )
        before, after = self.no_part
        low, middle, high = np.exp(np.quantile(_off(after, before), [0.0, 0.5, 1.0]))
        return (
            f"gains: {self.tried} were tried. On {len(after.error_mm)} draws that took no part in "
            f"the choice the error is {middle:.2f} times that of {self.start.method.gains} "
            f"({low:.2f} to {high:.2f}), {after.within} within the limits ({before.within})"
        )


def refine(
    read: Scene, start: Measured, judge: Judge, around: Draws, apart: Draws, last: Draws
) -> Refined:
    """The gains around those of a method of a scene with teleoperation, by draws `around`, on which
    `start` is, others `apart`, and the `last`, on which the choice is told. What fails in the first
    draw runs in no other."""
    known: dict[Point, Measured] = {(0, 0): start}
    costs: dict[Point, tuple[int, float]] = {(0, 0): _cost(start, start)}

    def cost(points: Sequence[Point]) -> list[tuple[int, float]]:
        near = [p for p in points if p not in costs and max(map(abs, p)) <= FARTHEST]
        methods = [scale_gains(read, start.method, p) for p in near]
        if start.keeps[0]:
            first = judge(methods, around[:1])
            costs.update({p: NEVER for p, one in zip(near, first, strict=True) if not one.admitted})
            methods = [one.method for one in first if one.admitted]
        ran = dict(zip((p for p in near if p not in costs), judge(methods, around), strict=True))
        known.update(ran)
        costs.update({p: _cost(one, start) for p, one in ran.items()})
        return [costs.get(p, NEVER) for p in points]

    *_, end = [(0, 0), *descend((0, 0), cost, STEPS, WORTH)]
    (before,) = judge([start.method], apart)
    far, taken = max(map(abs, end)), {0: before}

    def at(n: int) -> Point:
        return tuple(round(notches * n / far) for notches in end)

    def holds(n: int) -> bool:
        if cost([at(n)])[0] >= costs[0, 0]:
            return False
        (taken[n],) = judge([known[at(n)].method], apart)
        return _cost(taken[n], before) < _cost(before, before)

    n = int(largest_count(holds, far, far).value) if far else 0
    if not n:
        return Refined(start, start, None, len(costs) - 1)
    found = known[at(n)]
    old, new = judge([start.method, found.method], last)
    return Refined(start, found, (old, new), len(costs) - 1)


def _cost(found: Measured, start: Measured) -> tuple[int, float]:
    if (start.keeps & ~found.keeps).any():
        return NEVER
    return int((~found.keeps).sum()), float(np.quantile(_off(found, start), 0.75))


def _off(found: Measured, start: Measured) -> np.ndarray:
    """log(error/error of the start) of each draw."""
    new, old = (np.log(np.clip(one.error_mm, LEAST, 1 / LEAST)) for one in (found, start))
    return np.asarray(new - old)


def scale_gains(read: Scene, method: Method, notches: Point) -> Method:
    """The method with stiffness and damping scaled by notches, to four digits."""
    controller = open_scene.load(read, method.options).controller
    coupling = controller and controller.teleoperation
    assert coupling
    gains = {
        name: [float(f"{value * NOTCH**n:.4g}") for value in getattr(coupling, name)]
        for name, n in zip(("stiffness", "damping"), notches, strict=True)
    }
    options = {f"controller.teleoperation.{name}": value for name, value in gains.items()}
    told = ", ".join(f"{name} {value}" for name, value in gains.items())
    return Method(method.hold, told, overrides.write_options(options))
