"""Integrates a loop with a discrete mode from event to event, and samples it on a grid.

The mode is the number n of constrained directions. With the eigenvalues s_1 <= s_2 <= s_3 of
S Lambda^-1 S one more is constrained where s_{n+1} falls below rank_tolerance s_3, one less where
s_n rises above hysteresis times that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.integrate import solve_ivp

from hapticlink.components.linkage.parameters import mean_link_length
from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.scene.scene import Scene


class Guards:
    """The guards of a mode, n; they fall through 0 where it changes."""

    def __init__(self, scene: Scene, mobility: Callable[[np.ndarray], np.ndarray]) -> None:
        spec = scene.directions
        assert scene.linkage
        length = spec.length_scale or mean_link_length(scene.linkage)
        self.scale = np.array([1.0, 1.0, length])
        self._mobility = mobility
        self._tolerance, self._hysteresis = spec.rank_tolerance, spec.hysteresis

    def _shares(self, y: np.ndarray) -> np.ndarray:
        s = np.linalg.eigvalsh(self.scale[:, None] * self._mobility(y) * self.scale)
        return s / s[-1]

    def more(self, y: np.ndarray, mode: int) -> float:
        return float(self._shares(y)[mode] - self._tolerance) if mode < 3 else 1.0

    def less(self, y: np.ndarray, mode: int) -> float:
        if not mode:
            return 1.0
        return float(self._tolerance * self._hysteresis - self._shares(y)[mode - 1])


class Loop(Protocol):
    """y' = rate(t, y, mode); guards fall through 0 where the mode goes up or down by one."""

    start: np.ndarray
    first_mode: int
    handle: slice
    guards: Guards
    hand: Any

    def rate(self, t: float, y: np.ndarray, mode: int) -> np.ndarray: ...


@dataclass
class _Rate:
    """The right-hand side for one mode, until just before `end` (s)."""

    loop: Loop
    mode: int
    end: float

    def __call__(self, t: float, y: np.ndarray) -> np.ndarray:
        interrupt.raise_if_interrupted()
        return self.loop.rate(min(t, self.end), y, self.mode)


@dataclass
class _Guard:
    """An event of `solve_ivp` that ends an integration."""

    value: Callable[[np.ndarray, int], float]
    mode: int
    terminal: bool = True
    direction: int = -1

    def __call__(self, _: float, y: np.ndarray) -> float:
        return self.value(y, self.mode)


def march(loop: Loop, grid: np.ndarray, **method: Any) -> tuple[np.ndarray, list[float]]:
    """The handle's x and y (m) at the times `grid` (s), and the times at which the mode changes.

    Restarted at these, and where the hand's target has a corner; `method` goes to `solve_ivp`.
    Raises RuntimeError where the integrator gives up.
    """
    t, y, mode = 0.0, loop.start, loop.first_mode
    found, changes = np.full((len(grid), 2), np.nan), []
    found[0] = y[loop.handle]
    corners = [c for c in loop.hand.breaks if c < grid[-1]]
    while t < grid[-1]:
        end = next((c for c in corners if c > t), grid[-1])
        inside = (grid > t) & (grid <= end)
        times = np.unique(np.r_[grid[inside], end])
        solved = solve_ivp(
            _Rate(loop, mode, np.nextafter(end, 0)),
            (t, end),
            y,
            t_eval=times,
            events=[_Guard(each, mode) for each in (loop.guards.more, loop.guards.less)],
            **method,
        )
        if solved.status < 0:
            raise RuntimeError(f"the reference stopped at {solved.t[-1:]} s: {solved.message}")
        at = np.searchsorted(grid, solved.t)
        kept = np.isin(solved.t, grid)
        found[at[kept]] = solved.y[loop.handle, kept].T
        if solved.status == 1:
            up = len(solved.t_events[0]) > 0
            k = 0 if up else 1
            t, y = float(solved.t_events[k][0]), solved.y_events[k][0]
            mode += 1 if up else -1
            changes.append(t)
        else:
            t, y = end, solved.y[:, -1]
    return found, changes
