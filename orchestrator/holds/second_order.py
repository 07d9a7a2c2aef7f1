"""Second-order hold: the quadratic through the three newest samples, in Newton's form,

y_n + d1 (t - t_n) + d2 (t - t_n)(t - t_{n-1}),  d1 = [y_n, y_{n-1}],  d2 = [y_n, y_{n-1}, y_{n-2}]

with divided differences, so that periods may vary. Order 3; amplifies at most 2.83-fold, at
omega H = 2.61. With two samples it is the first-order hold, with one the zero-order hold.
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.history import OfSamples
from hapticlink.orchestrator.holds.polynomial_hold_laws import LAWS


class SecondOrder(OfSamples):
    laws = LAWS["SECOND_ORDER"]
    depth = 3
    degree = 2
    interpolates = True
