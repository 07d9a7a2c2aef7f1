"""The equilibrium of the lifted map: a state z with F(z) = z, by Newton's method.

    (I - A) d = F(z) - z,   z <- z + d

A of `linearise`; d is the one of least norm, in balanced coordinates, so that a free motion (an
eigenvalue of 1) stays where it is. A scene can have many equilibria, as with a mechanism that
stands or hangs, or within obstacles: the search begins where the run of the scene from its start
is nearest to rest, so that what a run settles to is what is found.
"""

from __future__ import annotations

import numpy as np

from hapticlink.analysis.stability.forward_sensitivity import SAME
from hapticlink.analysis.stability.lifted_map import LiftedMap
from hapticlink.analysis.stability.linearisation import Linearisation, linearised
from hapticlink.analysis.stability.modes import counted, modes
from hapticlink.analysis.stability.trajectory import (
    TOLERANCE,
    Trajectory,
    relative,
    require_constant,
    still,
)
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.faults import FmuFault, InputFault

ITERATIONS = 20
PATIENCE = 3
"""Steps of Newton in a row without halving the smallest residual that end a search."""
COARSE = 0.3
"""Largest relative difference of numbers for which Newton's method shares slopes."""
FINER = 0.1
"""Of that after a step that did not halve the smallest residual."""
HALVINGS = 6
"""Of a step of Newton's method that changes more over a period than where it begins."""
NEUTRAL = 1e-7
"""Singular values of the balanced I - A, relative to the largest, that count as 0."""


def equilibrium(map_: LiftedMap, run: Trajectory) -> Linearisation:
    """The map linearised at its equilibrium: the one that Newton's method finds from the state of
    the `run` that is nearest to rest. Where it finds none, as from a state off the contact that is
    to be closed, or one that a scene leaves without oscillation, it begins at other states of the
    run; of what it finds, the run passes nearest to the one that is taken.

    Raises InputFault where none is found, naming what does not come to rest.
    """
    equilibria: list[Linearisation] = []
    swings = False
    nearest: Linearisation | None = None
    for state in run.begins():
        try:
            linear = _newton(map_, state)
            resting = rests(linear) and still(map_, linear.image)
            if resting:
                require_constant(map_, linear.point, linear.taken)
        except FmuFault:
            continue
        if resting:
            equilibria.append(linear)
            if not _leaves(linear, map_.period):
                break
        elif rests(linear):
            swings = True
        elif nearest is None or unrest(linear).max() < unrest(nearest).max():
            nearest = linear
    if not equilibria:
        raise InputFault(_why_none(map_, nearest, run, swings))
    return min(equilibria, key=lambda linear: run.distances(linear.point).min())


def nearby(map_: LiftedMap, state: Vector) -> Linearisation | None:
    """The map linearised at the equilibrium that Newton's method finds from a `state`, such as that
    of another variant of the scene; None where there is none, or a scene leaves it without
    oscillation."""
    try:
        linear = _newton(map_, state)
        if not rests(linear) or _leaves(linear, map_.period) or not still(map_, linear.image):
            return None
    except FmuFault:
        return None
    require_constant(map_, linear.point, linear.taken)
    return linear


def _leaves(linear: Linearisation, period: float) -> bool:
    """Whether a motion grows without oscillation, as from a standing pendulum."""
    first = counted(modes(linear, period))[:1]
    return any(not m.z.imag and m.z.real - 1.0 > m.uncertainty for m in first)


def rests(linear: Linearisation) -> bool:
    """Whether the state is the same after a period."""
    return bool((unrest(linear) <= TOLERANCE).all())


def unrest(linear: Linearisation) -> Vector:
    """Along each direction, the change over a period, relative."""
    return relative(linear.change, linear.V.T @ linear.point)


def newton_step(linear: Linearisation) -> Vector:
    """d along each direction, of least norm in balanced coordinates."""
    d = linear.scales
    left = np.eye(len(d)) - linear.A * d / d[:, None]
    return d * np.linalg.lstsq(left, linear.change / d, rcond=NEUTRAL)[0]


def _newton(map_: LiftedMap, state: Vector) -> Linearisation:
    """Newton's method from `state`: the last point where the FMUs can be evaluated. Slopes are
    shared by numbers as different as the residual, so that over most of a long period, and with
    an error of each step that is of second order all the same; by fewer where it does not shrink.
    """
    linear, least, idle = linearised(map_, state, COARSE), np.inf, 0
    for _ in range(ITERATIONS):
        left = unrest(linear).max()
        idle = idle + 1 if left > least / 2 else 0
        if left <= TOLERANCE or idle == PATIENCE:
            break
        least = min(least, left)
        same = max(SAME, min(COARSE, left) * FINER**idle)
        try:
            linear = linearised(map_, _nearer(map_, linear, newton_step(linear)), same)
        except FmuFault:  # far from where it is linear
            break
    return linearised(map_, linear.point) if rests(linear) else linear


def _nearer(map_: LiftedMap, linear: Linearisation, step: Vector) -> Vector:
    """The end of a step, or of the part of it that changes less over a period than where it begins:
    a step that begins off a contact would end deep in it, where there may be a rest of another
    kind."""
    least = unrest(linear).max()
    for part in 0.5 ** np.arange(HALVINGS):
        there = linear.moved(part * step)
        try:
            change = linear.V.T @ (map_.image(there) - there)
        except FmuFault:
            continue
        if relative(change, linear.V.T @ there).max() < least:
            return there
    return linear.moved(step)


def _why_none(map_: LiftedMap, nearest: Linearisation | None, run: Trajectory, swings: bool) -> str:
    remedy = (
        "the lifted map is linearised around an equilibrium: take a hand that holds the mechanism, "
        "such as an arm or a spring, gains with which it comes to rest, and no wrench, drive or "
        "target that changes with time"
    )
    if swings:
        return (
            "no equilibrium found, but a limit cycle that repeats after "
            f"{map_.period:.4g} s, as where an instability ends at the torque limit of motors; "
            "take lower gains, or a start at rest"
        )
    if nearest is None:
        ended = f" before the run ends ({run.ended})" if run.ended else ""
        return f"no equilibrium found{ended}; {remedy}"
    along = nearest.V[:, int(np.argmax(unrest(nearest)))]
    j = int(np.argmax(np.abs(along)))
    change = nearest.image[j] - nearest.point[j]
    return (
        f"no equilibrium found: {map_.coordinates[j]} still changes by {change:.3g} in "
        f"{map_.period:.4g} s; {remedy}"
    )
