"""Baumgarte's stabilisation (3.3): stability limits of each method, and that the defaults help.

The closure error obeys hddot + 2 alpha beta hdot + alpha^2 h = 0, whose roots times the step T are
z = alpha T (-beta +- sqrt(beta^2 - 1)). A Runge-Kutta method multiplies them by its stability
polynomial R(z), semi-implicit Euler has the limit alpha T < 2 (sqrt(beta^2 + 1) - beta).
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from hapticlink.components.integrators import METHODS
from tests.blocks import Running, advance, running
from tests.mechanisms import WRENCH, five_bar

RATE = 512
TAYLOR = {"heun": (1, 1, 1 / 2), "rk4": (1, 1, 1 / 2, 1 / 6, 1 / 24)}


def mechanism(method, stabilization="baumgarte", **settings):
    settings |= {"integrator": method, "stabilization": stabilization}
    return running(five_bar(), step_s=1 / RATE, **settings).component


def limit(method, beta):
    """The smallest alpha T at which the error stops to shrink."""
    if method == "semi-implicit-euler":
        return 2 * (math.sqrt(beta**2 + 1) - beta)

    def growth(alpha_T):
        root = np.sqrt(complex(beta**2 - 1))
        R = np.polynomial.Polynomial(TAYLOR[method])
        return max(abs(R(alpha_T * (-beta + s * root))) for s in (1, -1)) - 1

    return brentq(growth, 0.5, 4.0)


def closure_after(component, steps):
    block = Running(component)
    block.put(q=block.state["q"] + (1e-6, 0, 0, 0))
    with np.errstate(all="ignore"):
        return advance(block, steps / RATE, RATE).y["closure_error"]


@pytest.mark.parametrize("beta", [0.5, 1.0])
@pytest.mark.parametrize("method", ["semi-implicit-euler", *TAYLOR])
@pytest.mark.parametrize("side", [0.96, 1.04])
def test_limit(method, beta, side):
    alpha = side * limit(method, beta) * RATE
    error = closure_after(mechanism(method, alpha=alpha, beta=beta), 400)
    assert (not error < 1e-6) == (side > 1)


def test_dormand_prince_8_has_its_limit_at_6_4():
    below, above = (
        closure_after(mechanism("dormand-prince-8", alpha=alpha_T * RATE, beta=1.0), 400)
        for alpha_T in (6.2, 6.6)
    )
    assert below < 1e-9
    assert not above < 1e-6


@pytest.mark.parametrize("alpha_T", [5.0, 50.0])
def test_linearly_implicit_has_no_limit(alpha_T):
    component = mechanism("linearly-implicit", alpha=alpha_T * RATE, beta=1.0)
    assert closure_after(component, 60) < 1e-9


@pytest.mark.parametrize("method", ["semi-implicit-euler", "heun"])
def test_dead_beat_defaults(method):
    """Two steps leave only what the equations add that are not linear in the gap, 1e-12."""
    assert closure_after(mechanism(method), 3) < 1e-10


@pytest.mark.parametrize(
    "method", [m for m in METHODS if m != "passive-midpoint"]
)  # which refuses the terms
def test_default_leaves_less_gap_than_none(method):
    worst = {}
    for kind in ("none", "baumgarte"):
        block, worst[kind] = Running(mechanism(method, kind)), 0.0
        block.set(F_hand=WRENCH)
        for _ in range(2 * RATE):
            block.step(1 / RATE)
            worst[kind] = max(worst[kind], block.y["closure_error"])
    assert worst["baumgarte"] < worst["none"]
