"""Kalman observer: pose, velocity and the hand's wrench, estimated jointly from the angles of the
driven joints, the torques of their motors and the device's dynamics (4.5).

The hand's wrench is a random walk, and counts are white noise. Over a period T, the torques held,

    a = M^-1 (J_q' tau + F - C v),   x <- x + T v + T^2 a/2,   v <- v + T a
    e = (J_q' J_q)^-1 J_q' (q - q(x))
    x <- x + g_1 e,   v <- v + g_2 e,   F <- F + M g_3 e

with q the measured angles. The steady Kalman filter of a mass has the poles of a Butterworth filter
of order 3, omega_n = (S/R)^(1/6), with S (m2/s5) the density of the noise that is the rate of F/M
and R (m2 s) that of the measured pose. That of samples has them at exp(omega_n T s): its gains are
those of `gains` to 1e-6 up to omega_n T = 0.5. As T -> 0

    F_observed/F = 1 / (s^3/omega_n^3 + 2 s^2/omega_n^2 + 2 s/omega_n + 1)

Counts make an error of F of M Delta sqrt(T omega_n^5)/6 (rms; Delta the displacement by a count,
whose variance is Delta^2/12), from which `bandwidth` takes omega_n.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from hapticlink.components.device.device_model import DeviceModel, Parameters
from hapticlink.components.device.motors_and_encoders import mass_and_count

NOISE = 0.05
"""Error of F by counts (N, rms) from which the default bandwidth follows."""
NOMINAL = 1 / 512
"""Period (s) of that bandwidth."""


def gains(omega_n: ca.SX, period: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """g_1 (1), g_2 (1/s), g_3 (1/s2), which put the poles of the estimation error of a mass at
    z = exp(omega_n T s), s those of a Butterworth filter of order 3; 0 where the period is 0.

    With w = z - 1 and h_i = g_i T^(i-1) its characteristic polynomial is

        w^3 + h_1 w^2 + h_2 z w + h_3 z (z + 1)/2

    of which the value and the slope at z = 1, and the value at 0, give h.
    """
    real, pair = ca.exp(-omega_n * period), ca.exp(-omega_n * period / 2)
    turned = 1 - pair * ca.cos(math.sqrt(3) / 2 * omega_n * period)
    square = pair**2 - 1 + 2 * turned  # (w + 1 - real) (w^2 + 2 turned w + square)
    h3 = (1 - real) * square
    h2 = square + 2 * turned * (1 - real) - 1.5 * h3
    T = ca.if_else(period > 0, period, 1)
    return 1 - real * pair**2, h2 / T, h3 / T**2


def bandwidth(model: DeviceModel) -> float:
    """omega_n (rad/s) at which counts make an error of F of NOISE at the period NOMINAL; at another
    one it is (NOMINAL/T)^(1/5) times that. M and Delta are means over the lengths that are felt,
    where the device is assembled."""
    mass, count = mass_and_count(model)
    return (6 * NOISE / (mass * count * math.sqrt(NOMINAL))) ** 0.4


class KalmanState(NamedTuple):
    """Estimated place of the device (n,), and velocity and wrench of the hand in the k directions
    in which it is felt."""

    place: ca.SX
    v: ca.SX
    F: ca.SX

    @property
    def states(self) -> dict[str, ca.SX]:
        """By the names that they have in a block."""
        return {"x_observer": self.place, "v_observer": self.v, "F_observer": self.F}

    def unsampled(self, guess: ca.SX) -> KalmanState:
        """The state before a first sample at which it is advanced by a period of 0."""
        return self


@dataclass(frozen=True)
class KalmanObserver:
    """The observer of a device with parameters p, `omega_n` among them."""

    device: DeviceModel
    p: Parameters

    def read(self, x: Mapping[str, ca.SX]) -> KalmanState:
        """That of a block with the states x."""
        return KalmanState(x["x_observer"], x["v_observer"], x["F_observer"])

    def start(self, angles: ca.SX, guess: ca.SX) -> KalmanState:
        """The handle at rest, without a force, with measured angles near a guessed place."""
        place, k = self.device.place_from_angles(angles, guess, self.p), self.device.directions.size
        return KalmanState(place, ca.SX.zeros(k), ca.SX.zeros(k))

    def advance(self, before: KalmanState, angles: ca.SX, tau: ca.SX, period: ca.SX) -> KalmanState:
        """The estimate with measured angles, a `period` (s) after a sample before it, over which
        the torques tau (N.m) were held."""
        device, p = self.device, self.p
        M, a = self._motion(before, tau)
        way = period * before.v + period**2 / 2 * a
        place, v = device.moved(before.place, way, p), before.v + period * a
        e = device.way_from_angles(angles, place, p)
        g1, g2, g3 = gains(p["omega_n"], period)
        return KalmanState(device.moved(place, g1 * e, p), v + g2 * e, before.F + M @ (g3 * e))

    def outputs(self, now: KalmanState) -> dict[str, ca.SX]:
        """By name: the handle's x, its velocity v, F_hand_observed, and M and c = C v there, all in
        the k directions."""
        M, c = self.device.motion(now.place, now.v, self.p)
        y = self.device.handle(now.place, self.p)
        return {"x": y, "v": now.v, "F_hand_observed": now.F, "M": M, "c": c}

    def acceleration(self, now: KalmanState, tau: ca.SX) -> ca.SX:
        """a = M^-1 (J_q' tau + F - C v) of (4.5) (m/s2, m/s2, rad/s2), (k,), with the torques tau
        (N.m) held."""
        return self._motion(now, tau)[1]

    def _motion(self, now: KalmanState, tau: ca.SX) -> tuple[ca.SX, ca.SX]:
        """M and a."""
        M, c = self.device.motion(now.place, now.v, self.p)
        return M, ca.solve(M, self.device.jacobian(now.place, self.p).T @ tau + now.F - c)
