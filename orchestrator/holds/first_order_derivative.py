"""First-order hold from the source's own derivative: y_n + yd_n s with s = t - t_n.

Order 2 from the first sample on and no delay at low frequency; unlike `foh` it does not amplify
noise by a difference of samples. The source must have its derivative as an output as well (v
beside x): a sample is y followed by yd (unit of y per s).
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.history import OfSamples
from hapticlink.orchestrator.holds.polynomial_hold_laws import LAWS


class FirstOrderDerivative(OfSamples):
    laws = LAWS["FIRST_ORDER_DERIVATIVE"]
    depth = 1
    needs = "derivative"
    degree = 1
