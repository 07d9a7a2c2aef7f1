"""Holds whose value is a polynomial in time, through samples or towards them. Their laws are in
`laws_of_holds`; s = t - t_n is the time since the newest stamp, H = t_n - t_{n-1}.

Until the second sample each of them is the zero-order hold, unless its docstring says otherwise.
"""

from __future__ import annotations

from hapticlink.orchestrator.holds.holds_of_samples import OfSamples, Transition
from hapticlink.orchestrator.holds.laws_of_holds import LAWS


class Lead(OfSamples):
    """Half-step lead: y_n + (y_n - y_{n-1})/2, constant until the next sample.

    The first-order hold evaluated at the middle of a period: order 2 where the target holds its
    inputs constant over the period, and no delay at low frequency. So it is where a period is a
    whole number of the target's steps h: at rates that do not divide each other the newest sample
    is h/2 older in the mean, an error of order 1.
    """

    laws = LAWS["LEAD"]


class FirstOrder(OfSamples):
    """First-order hold: y_n + (y_n - y_{n-1}) s/H. Order 2, no delay at low frequency; amplifies at
    most 1.59-fold, at omega H = 2.13."""

    laws = LAWS["FIRST_ORDER"]
    degree = 1
    interpolates = True


class FirstOrderDerivative(OfSamples):
    """First-order hold from the source's own derivative: y_n + yd_n s.

    Order 2 from the first sample on and no delay at low frequency; unlike `foh` it does not amplify
    noise by a difference of samples. The source must have its derivative as an output as well (v
    beside x): a sample is y followed by yd (unit of y per s).
    """

    laws = LAWS["FIRST_ORDER_DERIVATIVE"]
    depth = 1
    needs = "derivative"
    degree = 1


class SecondOrder(OfSamples):
    """Second-order hold: the quadratic through the three newest samples, in Newton's form,

    y_n + d1 (t - t_n) + d2 (t - t_n)(t - t_{n-1}),  d1 = [y_n, y_{n-1}],
    d2 = [y_n, y_{n-1}, y_{n-2}]

    with divided differences, so that periods may vary. Order 3; amplifies at most 2.83-fold, at
    omega H = 2.61. With two samples it is the first-order hold.
    """

    laws = LAWS["SECOND_ORDER"]
    depth = 3
    degree = 2
    interpolates = True


class Hermite(OfSamples):
    """Cubic Hermite hold: the cubic through the two newest samples and their derivatives.

    With r = (t - t_{n-1})/H: h00 y_{n-1} + h10 H yd_{n-1} + h01 y_n + h11 H yd_n,
    h00 = (1 + 2 r)(1 - r)^2, h10 = r (1 - r)^2, h01 = r^2 (3 - 2 r), h11 = r^2 (r - 1). Order 4.
    Meant for interpolation (coupling = "iterated"); extrapolated it amplifies more than the
    second-order hold. With one sample it is the first-order hold from the derivative.
    """

    laws = LAWS["HERMITE"]
    needs = "derivative"
    degree = 3
    interpolates = True


class Slope(OfSamples):
    """Slope hold, for the velocity beside a pose that `foh` holds: (x_n - x_{n-1})/H, x the pose.

    It is the rate of the held pose x_n + (x_n - x_{n-1}) s/H, so that a spring and damper get a
    pose and a velocity that agree; 0 until the second sample, as that pose is constant. As a
    velocity it is that of H/2 before t_n: order 1, and a delay of a period at low frequency. The
    source must have the pose as an output as well: a sample is the velocity followed by the pose
    (its unit times s).
    """

    laws = LAWS["SLOPE"]
    needs = "integral"


class Delayed(Transition):
    """Delayed interpolation: from the arrival of sample n, a straight line that reaches y_n after
    H: w + (y_n - w) min(1, r), with w the held value at the arrival and r H the time since then.

    w = y_{n-1} at a constant sampling period. Continuous, never overshoots the samples, and delayed
    by H: order 1.
    """

    laws = LAWS["DELAYED"]
    degree = 1


class Smooth(Transition):
    """Smooth hold: continuous in value and slope (C1), delayed by H.

    A cubic Hermite curve from the held value w and slope w' at the arrival of sample n to y_n with
    the slope (y_n - y_{n-1})/H, which it reaches H later and continues as a straight line. With r H
    the time since the arrival:

    w (1 + 2r)(1 - r)^2 + w' H r (1 - r)^2 + y_n r^2 (3 - 2r) + (y_n - y_{n-1}) r^2 (r - 1)

    Order 1.
    """

    laws = LAWS["SMOOTH"]
    slopes = LAWS["SMOOTH_SLOPE"]
    degree = 3
