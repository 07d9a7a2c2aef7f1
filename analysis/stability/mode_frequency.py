"""The frequency of a mode whose period is shorter than twice the hyperperiod P.

The argument of its eigenvalue is known up to whole turns only. The phase of a number c that the
mode moves, unwrapped over the events of the period, is omega P. It is exact as long as c turns by
less than half a turn between two events.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hapticlink.analysis.stability.modes import Mode
from hapticlink.orchestrator.base.arrays import Complex


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
