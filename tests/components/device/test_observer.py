"""Nicosia observer on a device of constant inertia, against its transfer function."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from hapticlink.components.device import discretisation
from hapticlink.components.device.observer import ForceObserver, State

MASS, OMEGA_N, K_D = 0.3, 50.0, 100.0


def observer_function(rule, n=1):
    x1, x2, pose, pose_next, F_motor = (ca.SX.sym("x", n) for _ in range(5))
    M, C = ca.SX.sym("M", n, n), ca.SX.sym("C", n, n)
    omega_n, k_D, period = (ca.SX.sym("gain") for _ in range(3))
    arguments = pose, pose_next, F_motor, M, C, period
    state = ForceObserver(rule, omega_n, k_D).step(State(x1, x2), *arguments)
    symbols = [x1, x2, pose, pose_next, F_motor, M, C, omega_n, k_D, period]
    return ca.Function("observer", symbols, list(state))


def matrices(rule, period, omega_n=OMEGA_N, k_D=K_D, mass=MASS):
    """z(k+1) = Phi z(k) + G0 x(k) + G1 x(k+1), read off the graph by unit inputs, n = 1."""
    f = observer_function(rule)

    def at(x1=0.0, x2=0.0, pose=0.0, pose_next=0.0):
        out = f(x1, x2, pose, pose_next, 0, mass, 0, omega_n, k_D, period)
        return np.array([float(v) for v in out])

    Phi = np.column_stack([at(x1=1), at(x2=1)])
    return Phi, at(pose=1), at(pose_next=1)


def sampled_response(rule, omega, period):
    """F_observed / F at z = exp(j omega T) for the exactly sampled mass under a continuous
    sine: x(k) = F / (-m omega^2)."""
    z = np.exp(1j * omega * period)
    Phi, G0, G1 = matrices(rule, period)
    x = -1 / (MASS * omega**2)
    x1 = np.linalg.solve(z * np.eye(2) - Phi, (G0 + z * G1) * x)[0]
    return MASS * OMEGA_N**2 * (x - x1)


@pytest.mark.parametrize("rule", ["forward", "backward", "trapezoidal"])
@pytest.mark.parametrize("omega", [1.0, 10.0, 50.0, 200.0])
def test_frequency_response(rule, omega):
    """F_observed/F = K_p / (M s^2 + k_D M s + K_p) as the sampling gets fast."""
    K_p, s = MASS * OMEGA_N**2, 1j * omega
    expected = K_p / (MASS * s**2 + K_D * MASS * s + K_p)
    error = [abs(sampled_response(rule, omega, T) - expected) for T in (1e-4, 5e-5)]
    assert error[1] < 0.01 * abs(expected)
    ratio = 4 if rule == "trapezoidal" else 2  # the rule's order
    assert error[0] / error[1] == pytest.approx(ratio, rel=0.15)


@pytest.mark.parametrize("rule", ["forward", "backward", "trapezoidal"])
@pytest.mark.parametrize("period", [1 / 512, 1 / 2000])
def test_unity_gain_at_dc(rule, period):
    """A constant force that the motors balance is observed whole, with no velocity."""
    f, F = observer_function(rule), 0.7
    x1, x2 = ca.DM(0), ca.DM(0)
    for _ in range(1000):
        x1, x2 = f(x1, x2, 0, 0, -F, MASS, 0, OMEGA_N, K_D, period)
    observer, state = ForceObserver(rule, ca.SX(OMEGA_N), ca.SX(K_D)), State(ca.SX(x1), ca.SX(x2))
    force = float(ca.DM(observer.force(state, ca.SX(0), ca.SX(MASS))))
    velocity = float(ca.DM(observer.velocity(state, ca.SX(0))))
    assert force == pytest.approx(F, rel=1e-9)
    assert velocity == pytest.approx(0, abs=1e-10)
    # the trap: x2 itself is biased by k_D F / K_p
    assert float(x2) == pytest.approx(-K_D * F / (MASS * OMEGA_N**2), rel=1e-9)


def test_bandwidth_and_damping():
    """omega_n = sqrt(K_p/M), zeta = (k_D/2) sqrt(M/K_p): poles of the continuous observer,
    recovered from the trapezoidal rule through z = (1 + sT/2)/(1 - sT/2)."""
    T, omega_n, k_D = 1e-3, 80.0, 60.0
    z = np.linalg.eigvals(matrices("trapezoidal", T, omega_n, k_D)[0])
    s = 2 / T * (z - 1) / (z + 1)
    np.testing.assert_allclose(np.abs(s), omega_n, rtol=1e-9)
    np.testing.assert_allclose(-s.real / np.abs(s), k_D / (2 * omega_n), rtol=1e-9)
    np.testing.assert_allclose(
        np.sort(z.imag), np.sort(discretisation.pole("trapezoidal", s * T).imag)
    )


@pytest.mark.parametrize("omega_n", [50.0, 200.0, 600.0])
def test_stability_limits_at_512_hz(omega_n):
    """Forward Euler: omega_n^2/512 < k_D < 1024 + omega_n^2/1024; the implicit rules: always."""

    def radius(rule, k_D):
        return np.abs(np.linalg.eigvals(matrices(rule, 1 / 512, omega_n, k_D)[0])).max()

    low, high = omega_n**2 / 512, 1024 + omega_n**2 / 1024
    assert radius("forward", 1.01 * low) < 1 < radius("forward", 0.99 * low)
    assert radius("forward", 0.99 * high) < 1 < radius("forward", 1.01 * high)
    for k_D in (0.5 * low, 2 * high):
        assert radius("backward", k_D) < 1
        assert radius("trapezoidal", k_D) < 1


def test_coriolis_term_enters_with_a_minus():
    """Three degrees of freedom, fine trapezoidal steps against the matrix exponential."""
    rng = np.random.default_rng(1)
    M, C = np.diag([0.3, 0.25, 3e-4]), 0.1 * rng.normal(size=(3, 3))
    C[2] *= 1e-3
    F, pose, n = np.array([0.2, -0.1, 1e-3]), np.array([0.01, 0.02, 0.3]), 400
    A = np.block(
        [[-K_D * np.eye(3), np.eye(3)], [-(OMEGA_N**2) * np.eye(3), -np.linalg.solve(M, C)]]
    )
    b = np.concatenate([K_D * pose, OMEGA_N**2 * pose + np.linalg.solve(M, F)])
    x1, x2 = ca.DM(pose), ca.DM.zeros(3)
    f = observer_function("trapezoidal", 3)
    for _ in range(n):
        x1, x2 = f(x1, x2, pose, pose, F, M, C, OMEGA_N, K_D, 0.05 / n)
    steady = np.linalg.solve(A, -b)
    expected = steady + expm(0.05 * A) @ (np.concatenate([pose, np.zeros(3)]) - steady)
    np.testing.assert_allclose(np.array(ca.vertcat(x1, x2)).ravel(), expected, rtol=1e-3, atol=1e-6)
