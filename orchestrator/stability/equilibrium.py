"""The equilibrium of the lifted map: a state z with F(z) = z, by Newton's method.

    (I - A) d = F(z) - z,   z <- z + d

A of `linearise`; d is the one of least norm, in balanced coordinates, so that a free motion (an
eigenvalue of 1) stays where it is. A unilateral contact makes F piecewise smooth: from a state on
the wrong piece there may be no equilibrium to find, so the search starts again from states that the
simulation passes through.
"""

from __future__ import annotations

import numpy as np

from hapticlink.orchestrator.base.faults import FmuFault, InputFault
from hapticlink.orchestrator.stability.lifted_map import LiftedMap, Vector
from hapticlink.orchestrator.stability.linearise import Linear, linearised
from hapticlink.orchestrator.stability.modes import counted, modes
from hapticlink.orchestrator.stability.tangent import SAME

TOLERANCE = 1e-9
"""Of each coordinate z, relative to max(1, |z|)."""
ITERATIONS = 20
PATIENCE = 3
"""Steps of Newton in a row without halving the smallest residual that end a search."""
COARSE = 0.03
"""Largest relative difference of numbers for which Newton's method shares slopes."""
HALVINGS = 6
"""Of a step of Newton's method that changes more over a period than where it begins."""
NEUTRAL = 1e-7
"""Singular values of the balanced I - A, relative to the largest, that count as 0."""


def equilibrium(map_: LiftedMap, seconds: float) -> Linear:
    """The map linearised at its equilibrium; the search starts from the start of the scene, and
    then from states that are passed within `seconds`. One that the scene leaves without oscillation
    is taken unless another one, nearer to the start, is found on the way.

    Raises InputFault where none is found, naming what does not come to rest.
    """
    state, passed, ahead = map_.start, 0, 1
    nearest: Linear | None = None
    left: Linear | None = None
    ended: FmuFault | None = None
    while passed * map_.period <= seconds:
        try:
            found = _newton(map_, state)
            if rests(found):
                leaves = _leaves(found, map_.period)
                if left is None or not leaves:
                    _require_rest(map_, found)
                    if not leaves:
                        both = (found,) if left is None else (left, found)
                        return min(both, key=lambda at: _way(map_, at))
                    left = found
            elif nearest is None or _unrest(found).max() < _unrest(nearest).max():
                nearest = found
            for _ in range(ahead):
                state = map_.image(state)
        except FmuFault as fault:  # diverges from here on
            ended = fault
            break
        passed, ahead = passed + ahead, 1 + passed // 2
    if left is not None:
        return left
    raise InputFault(_why_none(map_, nearest, ended))


def _leaves(at: Linear, period: float) -> bool:
    """Whether a motion grows without oscillation, as from a standing pendulum."""
    first = counted(modes(at, period))[:1]
    return any(not m.z.imag and m.z.real - 1.0 > m.uncertainty for m in first)


def _way(map_: LiftedMap, at: Linear) -> float:
    """How far the start is, relative, along the directions in which the map moves."""
    return float(_relative(at.V.T @ (at.point - map_.start), at.V.T @ at.point).max())


def _require_rest(map_: LiftedMap, at: Linear) -> None:
    """Raises InputFault where the second period is another map than the first one, as under a
    target that moves."""
    once, again = map_.image(at.image)[at.taken], map_.second(at.point)[at.taken]
    moved = _relative(again - once, once)
    if moved.max() > 10 * TOLERANCE:
        raise InputFault(
            f"the equilibrium moves with time, as under a drive or target that does: by "
            f"{moved.max():.1e} in {map_.period:.4g} s, seen in "
            f"{map_.coordinates[at.taken[int(np.argmax(moved))]]}; give `at`, a time from which "
            f"on nothing changes, here later than {map_.begin:.4g} s"
        )


def rests(at: Linear) -> bool:
    return bool((_unrest(at) <= TOLERANCE).all())


def _unrest(at: Linear) -> Vector:
    """Along each direction, the change over a period, relative."""
    return _relative(at.change, at.V.T @ at.point)


def _relative(change: Vector, z: Vector) -> Vector:
    """|change| of coordinates z, relative to max(1, |z|)."""
    found: Vector = np.abs(change) / np.maximum(1.0, np.abs(z))
    return found


def newton_step(at: Linear) -> Vector:
    """d along each direction, of least norm in balanced coordinates."""
    d = at.scales
    left = np.eye(len(d)) - at.A * d / d[:, None]
    found: Vector = d * np.linalg.lstsq(left, at.change / d, rcond=NEUTRAL)[0]
    return found


def _newton(map_: LiftedMap, state: Vector) -> Linear:
    """Newton's method from `state`: the last point where the FMUs can be evaluated. Slopes are
    shared by numbers as different as the residual allows, as long as it shrinks with them."""
    at, least, idle = linearised(map_, state, COARSE), np.inf, 0
    for _ in range(ITERATIONS):
        left = _unrest(at).max()
        idle = idle + 1 if left > least / 2 else 0
        if left <= TOLERANCE or idle == PATIENCE:
            break
        least = min(least, left)
        same = SAME if idle else max(SAME, min(COARSE, 0.1 * left))
        try:
            at = linearised(map_, _nearer(map_, at, newton_step(at)), same)
        except FmuFault:  # far from where it is linear
            break
    return linearised(map_, at.point) if rests(at) else at


def _nearer(map_: LiftedMap, at: Linear, step: Vector) -> Vector:
    """The end of a step, or of the part of it that changes less over a period than where it begins:
    a step that begins off a contact would end deep in it, where there may be a rest of another
    kind."""
    least = _unrest(at).max()
    for part in 0.5 ** np.arange(HALVINGS):
        there = at.moved(part * step)
        try:
            change = at.V.T @ (map_.image(there) - there)
        except FmuFault:
            continue
        if _relative(change, at.V.T @ there).max() < least:
            return there
    return at.moved(step)


def _why_none(map_: LiftedMap, nearest: Linear | None, ended: FmuFault | None) -> str:
    remedy = (
        "the map is linearised around a state of rest: take a hand that holds the mechanism, "
        "such as an arm or a spring, and no wrench, drive or target that changes with time"
    )
    if nearest is None:
        return f"no equilibrium found before the run ends ({ended}); {remedy}"
    along = nearest.V[:, int(np.argmax(_unrest(nearest)))]
    j = int(np.argmax(np.abs(along)))
    change = nearest.image[j] - nearest.point[j]
    return (
        f"no equilibrium found: {map_.coordinates[j]} still changes by {change:.3g} in "
        f"{map_.period:.4g} s; {remedy}"
    )
