"""The hand of a continuous loop: a constant wrench, or an arm behind a grip.

M_a x_a'' = K_a (x_t - x_a) + B_a (x_t' - x_a') - F,   F = K_gr (x_a - x) + B_gr (x_a' - v)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hapticlink.components.specs.hand import ArmHand, ConstantHand


class Hand:
    """moves: whether it has a state, (x_a, v_a). breaks: times (s) at which the rate of its target
    jumps. Raises ValueError for another hand than a constant wrench or an arm led along a table."""

    def __init__(self, spec: Any) -> None:
        arm = isinstance(spec, ArmHand) and isinstance(spec.target, tuple)
        if not (arm or (isinstance(spec, ConstantHand) and spec.damping is None)):
            raise ValueError(f"hand: {spec}; the reference knows a constant wrench and a led arm")
        self._spec, self.moves = spec, arm
        self._table = np.array(spec.target) if arm else np.zeros((1, 4))
        self.breaks = tuple(self._table[1:, 0]) if arm else ()

    def start(self, pose: np.ndarray) -> np.ndarray:
        """The arm rests at the handle."""
        return np.r_[pose, np.zeros(3)] if self.moves else np.zeros(0)

    def target(self, t: float) -> np.ndarray:
        """(x_t, x_t') at t (s), of the segment that begins there; zeros without an arm."""
        times, poses = self._table[:, 0], self._table[:, 1:]
        if len(times) < 2 or t >= times[-1]:
            return np.r_[poses[-1], np.zeros(3)]
        i = int(np.searchsorted(times, t, side="right")) - 1
        slope = (poses[i + 1] - poses[i]) / (times[i + 1] - times[i])
        return np.r_[poses[i] + (t - times[i]) * slope, slope]

    def rates(
        self, arm: Any, x: Any, v: Any, target: Any, column: Callable[..., Any]
    ) -> tuple[Any, tuple[Any, ...]]:
        """F and (x_a', v_a') at a handle's pose and velocity, for symbols or numbers; `column`
        makes a column of numbers."""
        spec = self._spec
        if not self.moves:
            return column(*spec.wrench), ()
        mass, K, B, K_gr, B_gr = (
            column(*getattr(spec, name))
            for name in ("mass", "stiffness", "damping", "grip_stiffness", "grip_damping")
        )
        F = K_gr * (arm[:3] - x) + B_gr * (arm[3:] - v)
        pull = K * (target[:3] - arm[:3]) + B * (target[3:] - arm[3:])
        return F, (arm[3:], (pull - F) / mass)
