"""The rules of section 1.3.1 against their definitions and the exact map of poles."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.components.device import discretisation

RULES = ("forward", "backward", "trapezoidal")
A = np.array([[-3.0, 2.0], [-40.0, -1.0]])
B = np.array([[1.0, 0.0], [0.5, 2.0]])


def step(rule, A, B, x, u, u_next, period):
    return np.array(
        ca.DM(discretisation.step(rule, *(ca.SX(ca.DM(a)) for a in (A, B, x, u, u_next, period))))
    )


def rates(rule, period=0.05):
    """x(k), x(k+1) and both rates for one step with changing inputs."""
    x, u, u_next = np.array([[0.3], [-1.2]]), np.array([[0.2], [1.0]]), np.array([[-0.4], [0.7]])
    after = step(rule, A, B, x, u, u_next, period)
    return (after - x) / period, A @ x + B @ u, A @ after + B @ u_next


def test_each_rule_is_its_equation():
    slope, now, then = rates("forward")
    np.testing.assert_allclose(slope, now, rtol=1e-12)  # (1.1)
    slope, now, then = rates("backward")
    np.testing.assert_allclose(slope, then, rtol=1e-12)  # (1.2)
    slope, now, then = rates("trapezoidal")
    np.testing.assert_allclose(slope, (then + now) / 2, rtol=1e-12)  # (1.3) as corrected


def test_printed_trapezoid_does_not_integrate_a_constant():
    """(1.3) is printed with xdot(k+1) - xdot(k): a constant rate would not move x."""
    zero, one = np.zeros((1, 1)), np.ones((1, 1))
    moved = step("trapezoidal", zero, one, zero, one, one, 0.25)
    printed = 0.25 * (one - one) / 2
    assert moved == pytest.approx(0.25)
    assert printed != pytest.approx(0.25)


@pytest.mark.parametrize("rule", RULES)
@given(re=st.floats(-50, 50), im=st.floats(-50, 50), period=st.floats(1e-3, 0.5))
def test_poles_go_where_the_map_says(rule, re, im, period):
    A = np.array([[re, im], [-im, re]])
    if abs(1 - discretisation.weight(rule) * complex(re, im) * period) < 1e-3:
        return
    columns = [
        step(rule, A, np.zeros((2, 1)), e[:, None], [0], [0], period)[:, 0] for e in np.eye(2)
    ]
    z = np.linalg.eigvals(np.array(columns).T)
    expected = discretisation.pole(rule, complex(re, im) * period)
    scale = max(1.0, abs(expected))
    assert np.min(np.abs(z - expected)) < 1e-9 * scale


def test_image_of_the_left_half_plane():
    """Figure 1.4: forward, the half plane left of 1; backward, the disc about 1/2 of radius
    1/2; trapezoidal, the unit disc."""
    s = -np.logspace(-3, 3, 40)[:, None] + 1j * np.linspace(-500, 500, 81)
    assert (discretisation.pole("forward", s).real < 1).all()
    assert (np.abs(discretisation.pole("forward", s)) > 1).any()
    assert (np.abs(discretisation.pole("backward", s) - 0.5) < 0.5).all()
    assert (np.abs(discretisation.pole("trapezoidal", s)) < 1).all()
    edge = 1j * np.linspace(-500, 500, 81)
    np.testing.assert_allclose(np.abs(discretisation.pole("backward", edge) - 0.5), 0.5, rtol=1e-12)
    np.testing.assert_allclose(np.abs(discretisation.pole("trapezoidal", edge)), 1, rtol=1e-12)
