"""The order of each method on an equation that depends on time, against SciPy."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hapticlink.components import integrators

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
