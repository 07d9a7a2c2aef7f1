"""Sines of time: y = mean + amplitude sin(2 pi frequency t + phase), each value with its own."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from hapticlink.components.specs.paths import AnySine
from hapticlink.components.time_signals import TimeSignal


class TimeSine(TimeSignal):
    """A sine of k values. Raises ValueError, with `name`, for numbers that are not finite."""

    def __init__(self, sine: AnySine, name: str) -> None:
        given = (sine.mean, sine.amplitude, sine.frequency, sine.phase)
        columns = np.array(given, float).reshape(4, -1)
        if not np.isfinite(columns).all():
            raise ValueError(f"`{name}`: the sine is {given}; give finite numbers")
        self.mean, self.amplitude, frequency, self.phase = map(ca.DM, columns)
        self.omega = 2 * math.pi * frequency
        self.size = columns.shape[1]

    def at(self, t: ca.SX) -> ca.SX:
        angle = self.omega * t + self.phase
        value = self.mean + self.amplitude * ca.sin(angle)
        return ca.vertcat(value, self.amplitude * self.omega * ca.cos(angle))
