"""Cubic Hermite hold: the cubic through the two newest samples and their derivatives.

With s = (t - t_{n-1})/H, H = t_n - t_{n-1}: h00 y_{n-1} + h10 H yd_{n-1} + h01 y_n + h11 H yd_n,
h00 = (1 + 2 s)(1 - s)^2, h10 = s (1 - s)^2, h01 = s^2 (3 - 2 s), h11 = s^2 (s - 1). Order 4. Meant
for interpolation (coupling = "iterated"); extrapolated it amplifies more than the second-order
hold. With one sample it is the first-order hold from the derivative.
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.history import OfSamples
from hapticlink.orchestrator.holds.polynomial_hold_laws import LAWS


class Hermite(OfSamples):
    laws = LAWS["HERMITE"]
    needs = "derivative"
    degree = 3
    interpolates = True
