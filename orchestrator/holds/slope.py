"""Slope hold, for the velocity beside a pose that `foh` holds: (x_n - x_{n-1})/H, x the pose.

It is the rate of the held pose x_n + (x_n - x_{n-1}) s/H, so that a spring and damper get a pose
and a velocity that agree; 0 until the second sample, as that pose is constant. As a velocity it is
that of H/2 before t_n: order 1, and a delay of a period at low frequency. The source must have the
pose as an output as well: a sample is the velocity followed by the pose (its unit times s).
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.history import OfSamples
from hapticlink.orchestrator.holds.polynomial_hold_laws import LAWS


class Slope(OfSamples):
    laws = LAWS["SLOPE"]
    needs = "integral"
