"""Half-step lead: y_n + (y_n - y_{n-1})/2, constant until the next sample.

The first-order hold evaluated at the middle of a period: order 2 where the target holds its inputs
constant over the period, and no delay at low frequency. So it is where a period is a whole number
of the target's steps h: at rates that do not divide each other the newest sample is h/2 older in
the mean, an error of order 1. Zero-order until the second sample.
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.history import OfSamples
from hapticlink.orchestrator.holds.polynomial_hold_laws import LAWS


class Lead(OfSamples):
    laws = LAWS["LEAD"]
