"""First-order hold: y_n + (y_n - y_{n-1}) s/H with s = t - t_n and H = t_n - t_{n-1}.

Order 2, no delay at low frequency; amplifies at most 1.59-fold, at omega H = 2.13. Zero-order
until the second sample.
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.history import OfSamples
from hapticlink.orchestrator.holds.polynomial_hold_laws import LAWS


class FirstOrder(OfSamples):
    laws = LAWS["FIRST_ORDER"]
    degree = 1
    interpolates = True
