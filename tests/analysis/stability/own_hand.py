"""A scene linearised at its equilibrium in its own hand, for comparison with closed forms."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import hapticlink as hl
from hapticlink.analysis.stability.forward_sensitivity import SMALL, STEP
from hapticlink.analysis.stability.hand_slopes import hand_slopes
from hapticlink.analysis.stability.lifted_map import LiftedMap
from hapticlink.analysis.stability.modes import (
    Linearisation,
    Mode,
    constant,
    judged_modes,
    leading,
    modes,
    verdict,
)
from hapticlink.analysis.stability.poses import in_own_hand

BILATERAL = {"fmu.wall.settings.unilateral": False, "hand.wrench": [0.0, 0.0, 0.0]}
"""Options of `virtual-wall` with which it pulls as it pushes, and nobody pushes against it."""
DAMPED: dict[str, Any] = BILATERAL | {"fmu.wall.settings.damping": 1.0}
LOST = 1e-6
"""Modes with a smaller |z| have vanished within a period."""


@dataclass(frozen=True)
class OwnHand:
    """Modes by decreasing |z|, without and with z = 1; numbers of the state at the equilibrium."""

    period: float
    modes: list[Mode]
    neutral: list[Mode]
    point: dict[str, float]
    kinks: np.ndarray
    """By direction the largest error of a slope, relative to the largest slope: of order 1 where
    the map is not differentiable."""
    participation: dict[str, float]

    @property
    def first(self) -> Mode:
        return judged_modes([*self.neutral, *self.modes])[0]

    @property
    def radius(self) -> float:
        return abs(self.first.z)

    @property
    def growth(self) -> float:
        return float(np.log(self.radius)) / self.period

    @property
    def verdict(self) -> str:
        return verdict(self.radius, self.first.uncertainty)


def linearised(map_: LiftedMap, point: np.ndarray) -> Linearisation:
    """The Jacobian of a map at a point by another road than that of linear_period.py: by central
    differences of the whole of F, carried out by the FMUs over a period for each number."""
    V = np.stack(list(map_.directions(point)), axis=1)
    image = map_.image(point)
    M, D = np.zeros((2, len(image), V.shape[1]))
    for j, v in enumerate(V.T):
        d = STEP * max(1.0, float(np.abs(point[v != 0.0]).max()))
        ahead, behind = (map_.image(point + way * v) for way in (d, -d))
        M[:, j], D[:, j] = (ahead - behind) / (2 * d), (ahead - 2 * image + behind) / (2 * d)
    taken = M.any(axis=0) | D.any(axis=0)
    V, M, D = V[:, taken], M[:, taken], D[:, taken]
    A, E = V.T @ M, V.T @ D
    kept = ~constant(A, V.T @ (image - point) == 0.0)
    return Linearisation(point, image, V[:, kept], A[kept][:, kept], E[kept][:, kept])


def own_hand(scene: str | Path | hl.Scene, options: Any = ()) -> OwnHand:
    with in_own_hand(hl.scene(scene, options)) as (place, hand):
        period = place.period({})
        point = dict(zip(map(str, place.map.coordinates), period.point.tolist(), strict=True))
        period = period.held({"hand": hand_slopes(hand, place.T)} if hand else {})
        every = [m for m in modes(period.linear, place.map.period) if abs(m.z) > LOST]
        some = [period.traced(mode) for mode in every if not mode.neutral]
        return OwnHand(
            place.map.period,
            some,
            [mode for mode in every if mode.neutral],
            point,
            np.abs(period.linear.E).max(axis=0)
            / np.maximum(np.abs(period.linear.A).max(axis=0), SMALL),
            dict(leading(every[0], period.names(), 6)),
        )
