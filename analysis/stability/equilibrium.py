"""The equilibrium of a lifted map next to a state: z with F(z) = z, by Newton's method.

    (I - A) d = F(z) - z,   z <- z + d

with the A of one point while the residual falls (linear_period.py). d is the one of least norm, in
balanced coordinates, so that a free motion (an eigenvalue of 1) stays where it is. Next to a rest
its singular value is not 0 but as small as what still moves; so what is as small as that is left
out until the rest does: equilibria lie side by side along it, and Newton's method would go far off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hapticlink.analysis.stability.lifted_map import LiftedMap
from hapticlink.analysis.stability.linear_period import LinearPeriod, linear_period
from hapticlink.analysis.stability.modes import Linearisation
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import InputFault

TOLERANCE = 1e-9
"""Of each coordinate z at rest, relative to max(1, |z|)."""
NEUTRAL = 1e-7
"""Singular values of the balanced I - A, relative to the largest, that count as 0."""
UNRESOLVED = 1e-4
"""Those that may be due to what still moves."""
STEPS, POINTS = 12, 6
"""Newton steps with the slopes of one point, and points."""


def equilibrium(map_: LiftedMap, near: Vector) -> LinearPeriod:
    """The period of the map at its equilibrium, searched from a state `near` it. Raises InputFault
    where there is none."""
    map_.work.counts["equilibria"] += 1
    for _ in range(POINTS):
        period = linear_period(map_, near)
        if period.moved <= TOLERANCE:
            return period
        near = _newton(map_, period)
    raise InputFault("no equilibrium is found in a hand that holds it")


def _newton(map_: LiftedMap, period: LinearPeriod) -> Vector:
    """The state after Newton's method with the slopes of one point, while it converges."""
    linear, residual = period.in_map, np.inf
    for _ in range(STEPS):
        linear = replace(linear, image=map_.image(linear.point))
        before, residual = residual, _residual(linear)
        if residual <= TOLERANCE:
            return linear.image  # in which all that is overwritten is as at rest
        if residual > before / 2:
            break
        linear = replace(linear, point=linear.moved(_step(linear)))
    return linear.point


def _residual(linear: Linearisation) -> float:
    """The largest change of a coordinate z over a period, relative to max(1, |z|)."""
    z = linear.V.T @ linear.point
    return float((np.abs(linear.change) / np.maximum(1.0, np.abs(z))).max(initial=0.0))


def _step(linear: Linearisation) -> Vector:
    d = linear.scales
    left, r = np.eye(len(d)) - linear.A * d / d[:, None], linear.change / d
    U, s, Vt = np.linalg.svd(left)
    r = U.T @ r
    moves = np.linalg.norm(r[s > UNRESOLVED])
    least = np.maximum(NEUTRAL * s.max(initial=0.0), np.minimum(moves, UNRESOLVED))
    return d * (Vt.T @ np.divide(r, s, out=np.zeros(len(r)), where=s > least))
