"""Closed forms of the largest stiffness of a sampled virtual wall.

A device of mass m (kg) and viscous damping b (N.s/m), with Coulomb friction f_c (N) and a position
in quanta (m), meets a wall of stiffness K and damping B sampled every T (s) with a zero-order hold,
whose force comes `periods` samples late. The velocity is the backward difference unless said
otherwise. All stiffnesses are in N/m.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Matrix = NDArray[np.float64]
GRID = 4096


def passive(b: float, T: float, B: float = 0.0) -> float:
    """K = 2 (b - |B|)/T, up to which the wall is passive for any hand: b > K T/2 + |B|.

    Colgate, Schenkel, J. Robotic Systems 14 (1997), 37.
    """
    return max(0.0, 2.0 * (b - abs(B)) / T)


def passive_damping(T: float, periods: int, K: Matrix, B: Matrix) -> Matrix:
    """The device's damping b (N.s/m) above which the wall is passive for any hand, for arrays K and
    B of one shape: the largest, over the frequency, of

        T/2 Re{(1 - 1/z) H(z)}/(1 - cos wT),   H = z^-d (K + B (1 - 1/z)/T),   z = exp(i w T)

    Colgate, Schenkel (1997), with the delay d = `periods`. At d = 0 it is K T/2 + |B|.
    """
    found: Matrix = np.full(K.shape, -np.inf)
    for angle in np.linspace(math.pi / 256, math.pi, 256):
        back = np.exp(-1j * angle)
        H = back**periods * (K + B * (1 - back) / T)
        found = np.maximum(found, T / 2 * ((1 - back) * H).real / (1 - math.cos(angle)))
    return found


def delayed(b: float, T: float, delay: float, B: float = 0.0) -> float:
    """K = (b + B)/(T/2 + t_d), up to which the wall is stable for small gains, t_d (s) the delay.

    Gil, Avello, Rubio, Florez, IEEE Trans. Control Systems Technology 12 (2004), 583, with the
    delay of Gil, Sanchez, Hulin, Preusche, Hirzinger, J. Comput. Inf. Sci. Eng. 9 (2009).
    """
    return (b + B) / (T / 2.0 + delay)


def quantised(b: float, T: float, friction: float, quantum: float) -> float:
    """K = min(2 b/T, 2 f_c/quantum), up to which a wall without damper is passive although the
    position is measured in whole quanta.

    Abbott, Okamura, IEEE Trans. Robotics 21 (2005), 952; Diolaiti, Niemeyer, Barbagli, Salisbury,
    IEEE Trans. Robotics 22 (2006), 256.
    """
    return min(2.0 * b / T, 2.0 * friction / quantum)


def undamped(m: float, T: float, B: float) -> float:
    """The stability limit for b = 0 without delay: with alpha = K T^2/m and beta = B T/m < 2,

        z^3 + (-2 + (alpha + beta)/2) z^2 + (1 + alpha/2) z - beta/2

    has no root outside of the unit circle up to alpha = 2 beta (2 - beta)/(2 + beta), by Jury's
    criterion; 0 for beta >= 2.
    """
    beta = B * T / m
    return max(0.0, 2.0 * beta * (2.0 - beta) / (2.0 + beta)) * m / T**2


def undamped_measured(T: float, B: float) -> float:
    """K = 2 B/T, the stability limit for b = 0 with a velocity that is read directly and small
    beta = B T/m: the map of (x, v) over T has the determinant 1 - beta + alpha/2."""
    return 2.0 * B / T


def damper(m: float, T: float) -> float:
    """B = 2 m/T (N.s/m), the stability limit of a sampled damper alone, for b = 0 and a velocity
    that is read directly: v_{k+1} = (1 - B T/m) v_k."""
    return 2.0 * m / T


def radius(m: float, b: float, T: float, periods: int, K: Matrix, B: Matrix) -> Matrix:
    """The spectral radius of the loop of `stable` for arrays K and B of one shape: the largest root
    of z^{d+1} (z - 1)(z - e) b + (K + B (1 - 1/z)/T)((T - tau (1 - e)) z + tau (1 - e) - T e) z."""
    tau = m / b
    e = math.exp(-T / tau)
    device = np.array([T - tau * (1 - e), tau * (1 - e) - T * e]) / b
    companion = np.zeros((*K.shape, periods + 3, periods + 3))
    companion[..., range(1, periods + 3), range(periods + 2)] = 1.0
    companion[..., 0, :2] = [1.0 + e, -e]
    for power, gain in ((0, K + B / T), (1, -B / T)):
        for i, g in enumerate(device):
            companion[..., 0, periods + power + i] -= gain * g
    found: Matrix = np.abs(np.linalg.eigvals(companion)).max(axis=-1)
    return found


def stable(m: float, b: float, T: float, periods: int = 0, B: float = 0.0) -> float:
    """The stability limit for b > 0: the smallest K > 0 at which 1 + z^-d (K + B (1 - 1/z)/T) G(z)
    has a root z = exp(i theta), with d = `periods` and the device behind its hold

        G(z) = ((T - tau (1 - e)) z + tau (1 - e) - T e) / (b (z - 1)(z - e))
        tau = m/b,   e = exp(-T/tau)

    Without delay and damper it is K = b^2 (1 - e)/(m (1 - e) - b T e). Raises ValueError for b <= 0
    and where the loop is stable for no K.
    """
    if b <= 0.0:
        raise ValueError(f"b = {b}: the limit without damping is that of `undamped`")
    tau = m / b
    e = math.exp(-T / tau)
    if not periods and not B:
        return b * b * (1 - e) / (m * (1 - e) - b * T * e)

    def gain(theta: float) -> complex:
        """The K, in general complex, with a root at exp(i theta)."""
        z = complex(math.cos(theta), math.sin(theta))
        G = ((T - tau * (1 - e)) * z + tau * (1 - e) - T * e) / (b * (z - 1) * (z - e))
        return -(z**periods) / G - B * (1 - 1 / z) / T

    angles = np.linspace(0.0, math.pi, GRID + 1)[1:]
    found = [gain(math.pi).real]
    for low, high in pairwise(angles):
        if gain(low).imag * gain(high).imag < 0:
            found.append(gain(brentq(lambda theta: gain(theta).imag, low, high)).real)
    limits = [K for K in found if K > 0]
    if not limits:
        raise ValueError(f"m = {m}, b = {b}, T = {T}, B = {B}: stable for no stiffness")
    return float(min(limits))
