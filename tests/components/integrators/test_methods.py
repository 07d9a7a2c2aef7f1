"""A tableau that does not add up is refused, whichever of its coefficients is wrong; the order of
each method on an equation that depends on time, against SciPy."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hapticlink.components import integrators
from hapticlink.components.integrators.runge_kutta import DORMAND_PRINCE_8, HEUN, RK4


@given(st.sampled_from([HEUN, RK4, DORMAND_PRINCE_8]), st.data())
def test_a_coefficient_that_is_off(tableau, data):
    """By as little as 1e-9."""
    off = data.draw(st.sampled_from([1e-9, -0.1, 1.0]))
    stages = len(tableau.b)
    i = data.draw(st.integers(1, stages - 1))
    j = data.draw(st.integers(0, i - 1))
    rows = [list(row) for row in tableau.a]
    rows[i][j] += off
    with pytest.raises(ValueError, match=f"row {i + 1} of a should sum to c"):
        replace(tableau, a=tuple(map(tuple, rows)))
    b = tuple(weight + off * (k == i) for k, weight in enumerate(tableau.b))
    with pytest.raises(ValueError, match="b should sum to 1 "):
        replace(tableau, b=b)


@pytest.mark.parametrize("tableau", [HEUN, RK4, DORMAND_PRINCE_8])
def test_an_order_that_is_claimed(tableau):
    with pytest.raises(ValueError, match=f"should sum to 1/{tableau.order + 1} for order"):
        replace(tableau, order=tableau.order + 1)


q, v, t = ca.SX.sym("q"), ca.SX.sym("v"), ca.SX.sym("t")
RATE = ca.vertcat(v, -4 * q - 0.5 * v - q**3 + ca.cos(5 * t))
START, END = (0.3, -0.2), 2.0


def end(method, steps):
    """(q, v) at END of a driven, damped Duffing oscillator."""
    x, u, p, h = ca.SX.sym("x", 2), ca.SX(0, 1), ca.SX(0, 1), ca.SX.sym("h")
    ode = ca.Function("ode", [ca.vertcat(q, v), ca.SX.sym("u", 0), ca.SX.sym("p", 0), t], [RATE])
    step = ca.Function("step", [x, t, h], [integrators.step(method, ode, x, u, p, t, h, [0])])
    found = ca.DM(START)
    for k in range(steps):
        found = step(found, k * END / steps, END / steps)
    return np.array(found).ravel()


@pytest.mark.parametrize("method", list(integrators.METHODS))
def test_the_error_falls_with_the_order(method):
    rate = ca.Function("rate", [ca.vertcat(q, v), t], [RATE])
    exact = solve_ivp(
        lambda time, x: np.array(rate(x, time)).ravel(), (0, END), START,
        method="DOP853", rtol=1e-13, atol=1e-14,
    ).y[:, -1]  # fmt: skip
    order = integrators.METHODS[method].order
    steps = 12 if order > 4 else 64
    coarse, fine = (np.linalg.norm(end(method, n) - exact) for n in (steps, 2 * steps))
    assert fine < 1e-3 * 20.0 ** (2 - order) * 50
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.4)
