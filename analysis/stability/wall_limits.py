"""Closed forms of the largest stiffness of a sampled virtual wall.

A device of mass m (kg) and viscous damping b (N.s/m), with Coulomb friction f_c (N) and a position
in quanta (m), meets a wall of stiffness K and damping B sampled every T (s) with a zero-order hold,
whose force comes `periods` samples late. The velocity is the backward difference unless said
otherwise. All stiffnesses are in N/m. All functions raise ValueError for a mass, period or quantum
that is not positive, and for a damping b, friction or delay that is negative.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from hapticlink.orchestrator.base.arrays import Matrix

GRID = 4096
SMALLEST = 1e-8
"""Smallest b T/m that a search for roots can tell from 0."""
SLOWEST = 1e-6
"""Smallest angle wT of a root on the unit circle that is looked for."""


def passive(b: float, T: float, B: float = 0.0) -> float:
    """K = 2 (b - |B|)/T, up to which the wall is passive for any hand: b > K T/2 + |B|.

    Colgate, Schenkel, J. Robotic Systems 14 (1997), 37.
    """
    _require_positive(T=T)
    _require_not_negative(b=b)
    return max(0.0, 2.0 * (b - abs(B)) / T)


def passive_damping(T: float, periods: int, K: Matrix, B: Matrix) -> Matrix:
    """The device's damping b (N.s/m) above which the wall is passive for any hand, for arrays K and
    B of one shape: the largest, over the frequency, of

        T/2 Re{(1 - 1/z) H(z)}/(1 - cos wT),   H = z^-d (K + B (1 - 1/z)/T),   z = exp(i w T)

    Colgate, Schenkel (1997), with the delay d = `periods`. At d = 0 it is K T/2 + |B|.
    """
    _require_positive(T=T)
    _require_not_negative(periods=periods)
    found: Matrix = np.full(K.shape, -np.inf)
    for angle in np.linspace(0.0, math.pi, 256 * (periods + 1) + 1)[1:]:
        back = np.exp(-1j * angle)
        H = back**periods * (K + B * (1 - back) / T)
        found = np.maximum(found, T / 2 * ((1 - back) * H).real / (1 - math.cos(angle)))
    return found


def limit_with_delay(b: float, T: float, delay: float, B: float = 0.0) -> float:
    """K = (b + B)/(T/2 + t_d), up to which the wall is stable for small gains, t_d (s) the delay.

    Gil, Avello, Rubio, Florez, IEEE Trans. Control Systems Technology 12 (2004), 583, with the
    delay of Gil, Sanchez, Hulin, Preusche, Hirzinger, J. Comput. Inf. Sci. Eng. 9 (2009).
    """
    _require_positive(T=T)
    _require_not_negative(b=b, delay=delay)
    return max(0.0, (b + B) / (T / 2.0 + delay))


def limit_with_quantum(b: float, T: float, friction: float, quantum: float) -> float:
    """K = min(2 b/T, 2 f_c/quantum), up to which a wall without damper is passive although the
    position is measured in whole quanta.

    Abbott, Okamura, IEEE Trans. Robotics 21 (2005), 952; Diolaiti, Niemeyer, Barbagli, Salisbury,
    IEEE Trans. Robotics 22 (2006), 256.
    """
    _require_positive(T=T, quantum=quantum)
    _require_not_negative(b=b, friction=friction)
    return min(2.0 * b / T, 2.0 * friction / quantum)


def limit_without_damping(m: float, T: float, B: float) -> float:
    """The stability limit for b = 0 without delay: with alpha = K T^2/m and beta = B T/m < 2,

        z^3 + (-2 + (alpha + beta)/2) z^2 + (1 + alpha/2) z - beta/2

    has no root outside of the unit circle up to alpha = 2 beta (2 - beta)/(2 + beta), by Jury's
    criterion; 0 for beta >= 2.
    """
    _require_positive(m=m, T=T)
    beta = B * T / m
    return max(0.0, 2.0 * beta * (2.0 - beta) / (2.0 + beta)) * m / T**2


def limit_with_measured_velocity(T: float, B: float) -> float:
    """K = 2 B/T, the stability limit for b = 0 with a velocity that is read directly and
    B < 2 m/T (`damper`): the map of (x, v) over T has the determinant 1 - beta + alpha/2."""
    _require_positive(T=T)
    return max(0.0, 2.0 * B / T)


def damper(m: float, T: float) -> float:
    """B = 2 m/T (N.s/m), the stability limit of a sampled damper alone, for b = 0 and a velocity
    that is read directly: v_{k+1} = (1 - B T/m) v_k."""
    _require_positive(m=m, T=T)
    return 2.0 * m / T


def radius(m: float, b: float, T: float, periods: int, K: Matrix, B: Matrix) -> Matrix:
    """The spectral radius of the loop of `stable` for arrays K and B of one shape: the largest root
    of z^{d+1} (z - 1)(z - e) b + (K + B (1 - 1/z)/T)((T - tau (1 - e)) z + tau (1 - e) - T e) z."""
    e, device = _device(m, b, T, periods)
    companion = np.zeros((*K.shape, periods + 3, periods + 3))
    companion[..., range(1, periods + 3), range(periods + 2)] = 1.0
    companion[..., 0, :2] = [1.0 + e, -e]
    for power, gain in ((0, K + B / T), (1, -B / T)):
        for i, g in enumerate(device):
            companion[..., 0, periods + power + i] -= gain * g
    return np.abs(np.linalg.eigvals(companion)).max(axis=-1)


def stable(m: float, b: float, T: float, periods: int = 0, B: float = 0.0) -> float:
    """The stability limit for b > 0: the smallest K > 0 above which the loop is unstable and below
    which it is stable, where 1 + z^-d (K + B (1 - 1/z)/T) G(z) has a root z = exp(i theta), with
    d = `periods` and the device behind its hold

        G(z) = ((T - tau (1 - e)) z + tau (1 - e) - T e) / (b (z - 1)(z - e))
        tau = m/b,   e = exp(-T/tau)

    Without delay and damper it is K = b^2 (1 - e)/(m (1 - e) - b T e), or, from b T/m = 3.721 on,
    the K of the root -1. Raises ValueError for b <= 0 and where the loop is stable for no K.
    """
    if b == 0.0:
        raise ValueError("b = 0: the limit is that of `limit_without_damping`")
    e, (first, second) = _device(m, b, T, periods)
    if not periods and not B:
        return min(-math.expm1(-b * T / m) / second, 2.0 * (1.0 + e) / (first - second))
    if b * T / m < SMALLEST:
        lost = f"b T/m below {SMALLEST} is lost in rounding"
        raise ValueError(f"b = {b}: {lost}; see `limit_without_damping`")

    def gain(theta: float) -> complex:
        """The K, in general complex, with a root at exp(i theta)."""
        z = complex(math.cos(theta), math.sin(theta))
        return -(z**periods) * (z - 1) * (z - e) / (first * z + second) - B * (1 - 1 / z) / T

    step = math.pi / GRID
    angles = [*np.geomspace(SLOWEST, step, GRID), *np.linspace(step, math.pi, GRID)[1:]]
    found = [gain(math.pi).real]
    for low, high in pairwise(angles):
        if gain(low).imag * gain(high).imag < 0:
            found.append(gain(brentq(lambda theta: gain(theta).imag, low, high)).real)
    limits = sorted(K for K in found if K > 0)
    between = np.convolve([0.0, *limits, 3.0 * max(limits, default=0.0)], [0.5, 0.5], "valid")
    outside = radius(m, b, T, periods, between, np.full(between.shape, B)) > 1.0
    for K, (below, above) in zip(limits, pairwise(outside), strict=True):
        if above and not below:
            return float(K)
    raise ValueError(f"m = {m}, b = {b}, T = {T}, periods = {periods}, B = {B}: stable for no K")


def _device(m: float, b: float, T: float, periods: int) -> tuple[float, tuple[float, float]]:
    """e of `stable`, and the numerator of G over b, without differences of nearly equal numbers
    where b T/m is small."""
    _require_positive(m=m, b=b, T=T)
    _require_not_negative(periods=periods)
    x = b * T / m
    e, mean = math.exp(-x), -math.expm1(-x) / x
    return e, (T / b * (1.0 - mean), T / b * (mean - e))


def _require_positive(**values: float) -> None:
    for name, value in values.items():
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} = {value}: must be positive and finite")


def _require_not_negative(**values: float) -> None:
    for name, value in values.items():
        if not 0.0 <= value < math.inf:
            raise ValueError(f"{name} = {value}: must not be negative, and finite")
