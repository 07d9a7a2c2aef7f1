"""The frequency of a mode whose period is shorter than twice the hyperperiod P.

The argument of its eigenvalue is known up to whole turns only. A mode v = a + i b is therefore
followed through the hyperperiod by two evaluations, from z + d a and z + d b: the coordinate with
the largest share, of an FMU or a signal, moves as c(t) = c_a + i c_b, and the phase of c, unwrapped
over the events, is omega P. It is exact as long as c turns by less than half a turn between two
events.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hapticlink.analysis.stability.forward_sensitivity import STEP
from hapticlink.analysis.stability.lifted_map import LiftedMap
from hapticlink.analysis.stability.linearisation import Linearisation
from hapticlink.analysis.stability.modes import Mode
from hapticlink.orchestrator.base.arrays import Complex, Vector


def traced(map_: LiftedMap, linear: Linearisation, mode: Mode) -> Mode:
    """The mode with its frequency beyond the argument of its eigenvalue."""
    if map_.events == 1:
        return mode
    held = [map_.coordinates[i].kind == "hold" for i in linear.taken]
    j = int(linear.taken[np.argmax(np.where(held, 0.0, mode.participation))])
    v = mode.vector * (STEP / np.max(np.abs(mode.vector) / np.maximum(1.0, np.abs(linear.point))))
    unmoved = _followed(map_, linear.point, j)
    paths = [_followed(map_, linear.point + part, j) - unmoved for part in (v.real, v.imag)]
    return with_turns(mode, np.array([v[j], *(paths[0] + 1j * paths[1])]), map_.period)


def with_turns(mode: Mode, path: Complex, period: float) -> Mode:
    """The mode with the frequency of a number that moves along `path` in a period (s)."""
    path = path[np.abs(path) > 0]
    if len(path) < 2:
        return mode
    if mode.z.imag == 0.0:  # a real mode changes its sign at half turns
        turns = np.count_nonzero(np.diff(np.sign(path.real))) / 2
        return replace(mode, omega=2 * np.pi * turns / period)
    whole = np.unwrap(np.angle(path))[-1] - np.angle(path[0])
    argument = np.angle(mode.z)
    turns = np.round((whole - argument) / (2 * np.pi))
    return replace(mode, omega=abs(argument + 2 * np.pi * turns) / period)


def _followed(map_: LiftedMap, point: Vector, j: int) -> Vector:
    """The coordinate j after each event."""
    seen: list[float] = []
    map_.image(point, lambda state: seen.append(float(state[j])))
    return np.array(seen)
