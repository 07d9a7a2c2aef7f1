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

from hapticlink.components.device import pantograph
from hapticlink.components.device.motors_and_encoders import numbers
from hapticlink.components.device.observer import Kinematics, Parameters
from hapticlink.components.specs.device import Device

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


def bandwidth(device: Device) -> float:
    """omega_n (rad/s) at which counts make an error of F of NOISE at the period NOMINAL; at another
    one it is (NOMINAL/T)^(1/5) times that. M and Delta are means over x and y, midway between the
    bases.

    Raises ValueError where the arms do not reach there.
    """
    p = numbers(device)
    pose = ca.DM([device.base_x, (device.base_y_a + device.base_y_b) / 2, 0])
    x = ca.SX.sym("x", 3)
    J, (M, _) = pantograph.jacobian(x, p), pantograph.motion(x, ca.SX(3, 1), p)
    mass, count = ca.sqrt(ca.det(M[:2, :2])), ca.sqrt(ca.trace(ca.inv(J.T @ J)[:2, :2]) / 2)
    product = float(ca.Function("product", [x], [mass * count])(pose))
    found = (6 * NOISE / (product * device.encoder_resolution * math.sqrt(NOMINAL))) ** 0.4
    if not math.isfinite(found):
        raise ValueError(
            "`device.observer.omega_n` has no default with law = 'kalman': the arms do not reach "
            "the middle between their bases; give it in rad/s"
        )
    return found


class KalmanState(NamedTuple):
    """Estimated pose (m, m, rad), velocity, and wrench of the hand (N, N, N.m), each (n,)."""

    x: ca.SX
    v: ca.SX
    F: ca.SX

    @property
    def states(self) -> dict[str, ca.SX]:
        """By the names that they have in a block."""
        return {"x_observer": self.x, "v_observer": self.v, "F_observer": self.F}

    def unsampled(self, guess: ca.SX) -> KalmanState:
        """The state before a first sample at which it is advanced by a period of 0."""
        return self


@dataclass(frozen=True)
class KalmanObserver:
    """The observer of a device with parameters p, `omega_n` among them."""

    device: Kinematics
    p: Parameters

    def read(self, x: Mapping[str, ca.SX]) -> KalmanState:
        """That of a block with the states x."""
        return KalmanState(x["x_observer"], x["v_observer"], x["F_observer"])

    def start(self, angles: ca.SX, guess: ca.SX) -> KalmanState:
        """The handle at rest, without a force, with measured angles (rad) near a guessed pose."""
        pose = self.device.pose_from_angles(angles, guess, self.p)
        return KalmanState(pose, ca.SX.zeros(pose.numel()), ca.SX.zeros(pose.numel()))

    def advance(self, before: KalmanState, angles: ca.SX, tau: ca.SX, period: ca.SX) -> KalmanState:
        """The estimate with measured angles (rad), a `period` (s) after a sample before it, over
        which the torques tau (N.m) were held."""
        M, a = self._motion(before, tau)
        x, v = before.x + period * before.v + period**2 / 2 * a, before.v + period * a
        e = self.device.pose_from_angles(angles, x, self.p, iterations=1) - x
        g1, g2, g3 = gains(self.p["omega_n"], period)
        return KalmanState(x + g1 * e, v + g2 * e, before.F + M @ (g3 * e))

    def outputs(self, now: KalmanState) -> dict[str, ca.SX]:
        """By name: pose x, velocity v, F_hand_observed, and M and c = C v there."""
        M, c = self.device.motion(now.x, now.v, self.p)
        return {"x": now.x, "v": now.v, "F_hand_observed": now.F, "M": M, "c": c}

    def acceleration(self, now: KalmanState, tau: ca.SX) -> ca.SX:
        """a = M^-1 (J_q' tau + F - C v) of (4.5) (m/s2, m/s2, rad/s2), (n,), with the torques tau
        (N.m) held."""
        return self._motion(now, tau)[1]

    def _motion(self, now: KalmanState, tau: ca.SX) -> tuple[ca.SX, ca.SX]:
        """M and a."""
        M, c = self.device.motion(now.x, now.v, self.p)
        return M, ca.solve(M, self.device.jacobian(now.x, self.p).T @ tau + now.F - c)
