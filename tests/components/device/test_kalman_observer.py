"""Kalman observer: its gains against SciPy's Riccati equation, its response and its noise on a
device of constant inertia, against closed forms."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are, solve_discrete_lyapunov

from hapticlink.components.blocks.haptic_device import haptic_device
from hapticlink.components.device.kalman_observer import (
    NOISE,
    NOMINAL,
    KalmanObserver,
    KalmanState,
    bandwidth,
    gains,
)
from hapticlink.components.device.models import device_model
from hapticlink.components.specs.device import Observer
from tests.blocks import Running
from tests.devices import device as twin

MASS = 0.3
H = np.eye(3)[:1]


def numbers(omega_n, period):
    return np.array([float(ca.evalf(g)) for g in gains(ca.SX(omega_n), ca.SX(period))])


def transition(period):
    return np.array([[1, period, period**2 / 2], [0, 1, period], [0, 0, 1]])


def riccati(omega_n, period):
    """The gains of the steady Kalman filter of a mass, white noise of density omega_n^6 as the rate
    of F/M and of density 1 on the pose."""
    A, noise = np.eye(3, k=1), np.diag([0, 0, omega_n**6])
    van_loan = expm(np.block([[-A, noise], [np.zeros((3, 3)), A.T]]) * period)
    Q, R = transition(period) @ van_loan[:3, 3:], np.array([[1 / period]])
    P = solve_discrete_are(transition(period).T, H.T, (Q + Q.T) / 2, R)
    return (P @ H.T / (H @ P @ H.T + R)).ravel()


@pytest.mark.parametrize("omega_n", [1.0, 50.0, 119.0, 600.0])
@pytest.mark.parametrize("period", [1 / 512, 1 / 4000])
def test_poles_are_those_of_a_butterworth_filter_at_any_period(omega_n, period):
    error = (np.eye(3) - np.outer(numbers(omega_n, period), H)) @ transition(period)
    s = omega_n * np.exp(1j * np.pi * np.array([2 / 3, 1, 4 / 3]))
    expected = np.poly(np.exp(s * period)).real
    np.testing.assert_allclose(np.poly(error), expected, atol=1e-12)


@pytest.mark.parametrize("omega_n", [20.0, 60.0, 119.0, 240.0])
@pytest.mark.parametrize("period", [1 / 512, 1 / 2000])
def test_gains_are_those_of_the_riccati_equation(omega_n, period):
    np.testing.assert_allclose(numbers(omega_n, period), riccati(omega_n, period), rtol=1e-6)


class Mass:
    """A device of one direction, whose angle is the pose."""

    def way_from_angles(self, angles, z, p):
        return angles - z

    def moved(self, z, dy, p):
        return z + dy

    def jacobian(self, pose, p):
        return ca.SX.eye(1)

    def motion(self, pose, v, p):
        return ca.SX(MASS), ca.SX(0)


def response_of_a_mass(omega_n, period):
    """F_observed/F at z = exp(j omega T) of the graph, for a mass whose pose under a continuous
    sine of F is F/(-m omega^2); and the graph's matrices of state and of pose."""
    state, angle, T = (ca.SX.sym("s", n) for n in (3, 1, 1))
    observer = KalmanObserver(Mass(), {"omega_n": ca.SX(omega_n)})
    after = observer.advance(KalmanState(*ca.vertsplit(state)), angle, ca.SX(0), T)
    f = ca.Function("observer", [state, angle, T], [ca.vertcat(*after)])
    Phi = np.column_stack([np.array(f(unit, 0, period)).ravel() for unit in np.eye(3)])
    into = np.array(f(np.zeros(3), 1, period)).ravel()

    def at(omega):
        z = np.exp(1j * omega * period)
        return np.linalg.solve(z * np.eye(3) - Phi, z * into)[2] / (-MASS * omega**2)

    return at, Phi, into


@pytest.mark.parametrize("omega", [1.0, 50.0, 119.0, 400.0])
def test_the_observed_force_follows_as_a_butterworth_filter(omega):
    s = 1j * omega / 119.0
    expected = 1 / (s**3 + 2 * s**2 + 2 * s + 1)
    off = [abs(response_of_a_mass(119.0, T)[0](omega) - expected) for T in (1e-4, 5e-5)]
    assert off[1] < 0.02 * abs(expected)
    assert off[0] / off[1] == pytest.approx(2, rel=0.15)


def test_it_is_passive_up_to_the_root_of_two_of_its_bandwidth():
    """The handle's mobility (F_observed/L + (F - F_observed)/M)/s, L > M, has a positive real part
    where that of F_observed/F s is positive."""
    at, _, _ = response_of_a_mass(119.0, 1e-5)
    for share, sign in ((0.3, 1), (1.0, 1), (1.35, 1), (1.5, -1)):
        assert np.sign(-at(share * 119.0).imag) == sign


def test_counts_make_the_error_of_the_force_that_its_bandwidth_is_taken_for():
    """White noise of a count's variance on the pose of a mass: the closed form, and at the default
    bandwidth NOISE. It is a continuous-time form: 512 Hz is fast enough for a tenth."""
    count, period = 2e-4, NOMINAL
    omega_n = (6 * NOISE / (MASS * count * math.sqrt(period))) ** 0.4
    _, Phi, into = response_of_a_mass(omega_n, period)
    variance = solve_discrete_lyapunov(Phi, count**2 / 12 * np.outer(into, into))[2, 2]
    assert math.sqrt(variance) == pytest.approx(NOISE, rel=0.1)


def test_the_default_bandwidth_is_that_of_the_device_s_inertia_and_counts():
    """At the pose midway between the bases, with M and J from the device's own outputs."""
    middle = (-0.005, 0.0, 0.0)
    M = Running(haptic_device(twin()), {}, {"x_start": middle}).y["M"].reshape(3, 3)
    bare = haptic_device(replace(twin(), observer=Observer(beside=True)), encoders=True)

    def angles(pose):
        return Running(bare, {}, {"x_start": pose}).y["q_true"]

    small = 1e-6
    J = np.column_stack(
        [(angles(middle + d) - angles(middle - d)) / 2 / small for d in small * np.eye(3)]
    )
    spread = np.linalg.inv(J.T @ J)
    count = twin().encoders[0].resolution * np.sqrt((spread[0, 0] + spread[1, 1]) / 2)
    mass = np.sqrt(np.linalg.det(M[:2, :2]))
    omega_n = bandwidth(device_model(twin()))
    assert mass * count * np.sqrt(NOMINAL * omega_n**5) / 6 == pytest.approx(NOISE, rel=1e-6)


def test_the_default_bandwidth_follows_the_period():
    """At 1024 Hz it is 2^(1/5) times that at 512 Hz, to the last digits of what is observed."""
    T, hand = 1 / 1024, (0.3, -0.2, 0.001)
    omega_n = bandwidth(device_model(twin())) * 2**0.2

    def seen(spec, **parameters):
        device = haptic_device(replace(twin(), observer=spec), encoders=True)
        run = Running(device, {"F_hand": hand}, parameters)
        for _ in range(60):
            run.step(T)
        return run.y["F_hand_observed"]

    by_default = seen(Observer(law="kalman"), step_size=T)
    np.testing.assert_allclose(by_default, seen(Observer(law="kalman", omega_n=omega_n)), rtol=1e-9)
    assert np.abs(by_default / seen(Observer(law="kalman", omega_n=90.0)) - 1).max() > 0.01
