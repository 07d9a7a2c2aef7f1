"""Smooth hold: continuous in value and slope (C1), delayed by a period H = t_n - t_{n-1}.

A cubic Hermite curve from the held value w and slope w' at the arrival of sample n to y_n with the
slope (y_n - y_{n-1})/H, which it reaches H later and continues as a straight line. With r = s/H and
s the time since the arrival:

w (1 + 2r)(1 - r)^2 + w' H r (1 - r)^2 + y_n r^2 (3 - 2r) + (y_n - y_{n-1}) r^2 (r - 1)

Order 1. The first sample is held until the second arrives.
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.history import Transition
from hapticlink.orchestrator.holds.polynomial_hold_laws import LAWS


class Smooth(Transition):
    laws = LAWS["SMOOTH"]
    slopes = LAWS["SMOOTH_SLOPE"]
    degree = 3
