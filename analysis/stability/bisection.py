"""The largest scale at which something holds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hapticlink.orchestrator.base.errors import InputFault

DOUBLINGS = 10
"""How often a scale is doubled or halved on the way to a limit."""


def largest(holds: Callable[[float], bool], fine: float) -> float:
    """The largest scale that holds on the way from 1, found by doubling or halving it and then to
    `fine` of its logarithm. Raises InputFault where none does."""
    low = high = 0.0
    if holds(1.0):
        while holds(np.exp(high := high + np.log(2.0))):
            low = high
            if low > DOUBLINGS * np.log(2.0):
                return float(np.exp(low))
    else:
        while not holds(np.exp(low := low - np.log(2.0))):
            high = low
            if low < -DOUBLINGS * np.log(2.0):
                raise InputFault(f"none holds down to {np.exp(low):.1g} times the scene's")
    while high - low > fine:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(float(np.exp(middle))) else (low, middle)
    return float(np.exp(low))
