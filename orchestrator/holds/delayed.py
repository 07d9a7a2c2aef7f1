"""Delayed interpolation: from the arrival of sample n, a straight line that reaches y_n after
H = t_n - t_{n-1}.

w + (y_n - w) min(1, s/H), with w the held value at the arrival and s the time since then;
w = y_{n-1} at a constant sampling period. Continuous, never overshoots the samples, and delayed
by H: order 1.
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.history import Transition
from hapticlink.orchestrator.holds.polynomial_hold_laws import LAWS


class Delayed(Transition):
    laws = LAWS["DELAYED"]
    degree = 1
