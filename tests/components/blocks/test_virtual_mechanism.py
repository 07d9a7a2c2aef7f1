"""The virtual mechanism against SciPy on the hand-written five-bar, and its stabilisations."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

from hapticlink.components.integrators import METHODS
from studies.report import appendix_a
from studies.report.appendix_a import L
from tests.blocks import Running, order, running
from tests.mechanisms import Q0, WRENCH, five_bar, open_arm


def reference(q0, t_end):
    """(q, qd) at t_end by DOP853 on Appendix A, with the constant wrench of chapter 6."""

    def f(_, y):
        return np.r_[y[4:], appendix_a.acceleration(y[:4], y[4:], WRENCH)[0]]

    start = np.r_[q0, np.zeros(4)]
    return solve_ivp(f, (0, t_end), start, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]


def largest_gap(block, steps, t_end):
    """The largest closure error of a motion under the wrench, m."""
    block.set(F_hand=WRENCH)
    gaps = [block.y["closure_error"]]
    for _ in range(steps):
        block.step(t_end / steps)
        gaps.append(block.outputs("closure_error")["closure_error"])
    return max(gaps)


def errors(component, counts, t_end):
    """Of the state after so many steps against DOP853, and the largest closure error."""
    exact, found, gaps = reference(Running(component).state["q"], t_end), [], []
    for count in counts:
        block = Running(component)
        gaps.append(largest_gap(block, count, t_end))
        found.append(np.abs(block.x[:8] - exact).max())
    return found, max(gaps)


def test_accelerations_and_multipliers_while_moving():
    rng = np.random.default_rng(1)
    block = running(five_bar())
    q, qd = block.state["q"], rng.uniform(-3, 3, 4)
    block.put(qd=qd)
    block.set(F_hand=WRENCH, F_drift=(0.1, 0.2, 0.003))
    wrench = np.array(WRENCH) - (0.1, 0.2, 0.003)
    qdd, multipliers = appendix_a.acceleration(q, qd, wrench)
    np.testing.assert_allclose(block.y["qdd"], qdd, rtol=1e-11)
    np.testing.assert_allclose(block.y["lambda"], multipliers, rtol=1e-11)
    free, _ = appendix_a.acceleration(q, qd, np.zeros(3))
    step = 1e-6
    Jdot = (appendix_a.J_h(q + step * qd) - appendix_a.J_h(q - step * qd)) / (2 * step)
    bias = appendix_a.J_h(q) @ free + Jdot @ qd
    np.testing.assert_allclose(block.y["a_bias"], bias, rtol=1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_observed_order(method):
    """Slope of log error on log step, errors against DOP853 with its own step control."""
    claimed = METHODS[method].order
    # The eighth order is at rounding from 1/32 s on.
    counts, end = ([8, 10, 12, 16], 1.0) if claimed == 8 else ([64, 128, 256, 512], 0.25)
    component = running(five_bar(), integrator=method, stabilization="none").component
    found, _ = errors(component, counts, end)
    assert order(found, counts) == pytest.approx(claimed, abs=0.4 if claimed == 8 else 0.2)


@pytest.mark.parametrize("method", METHODS)
def test_projection_keeps_closure_to_rounding_and_the_order(method):
    claimed = METHODS[method].order
    counts, end = ((16, 24), 1.0) if claimed == 8 else ((128, 256), 0.25)
    component = running(five_bar(), integrator=method, stabilization="projection").component
    found, gap = errors(component, counts, end)
    assert gap < 1e-15
    assert order(found, counts) == pytest.approx(claimed, abs=1.5 if claimed == 8 else 0.25)


def test_closure_under_semi_implicit_euler():
    """Figures 3.3 and 3.4: it drifts without (B.17)'s w_stab, Baumgarte at dead beat holds it to
    9 um."""
    euler = {"step_s": 1 / 512, "integrator": "semi-implicit-euler"}
    drift, held = (
        largest_gap(running(five_bar(), **euler, stabilization=kind), 3 * 512, 3.0)
        for kind in ("none", "baumgarte")
    )
    assert drift > 1e-3
    assert held == pytest.approx(9e-6, rel=0.02)  # independent sketch of the same scheme: 9 um
    assert held < 1e-3 * min(L)


def test_an_open_chain_has_no_multiplier():
    assert not {"lambda", "closure_error"} & set(running(open_arm(five_bar())).y)


def test_energy_is_the_work_of_the_hand():
    """RK4 at 1/512 s: the hand's work, by trapezoids, is the kinetic energy."""
    block, work = running(five_bar()), 0.0
    block.set(F_hand=WRENCH)
    x = block.y["x"]
    for _ in range(512):
        block.step(1 / 512)
        work += np.dot(WRENCH, block.y["x"] - x)
        x = block.y["x"]
    assert block.y["energy"] == pytest.approx(work, rel=1e-8)


def test_start_pose_is_hardly_farther_than_the_nearest_closed_one():
    """Against the constrained least-squares solution by SciPy; Newton's differs at second order."""
    q = running(five_bar()).state["q"]
    best = minimize(
        lambda q: np.sum((q - Q0) ** 2),
        Q0,
        jac=lambda q: 2 * (q - Q0),
        constraints={"type": "eq", "fun": appendix_a.h, "jac": appendix_a.W, "args": (L,)},
        method="SLSQP",
        options={"ftol": 1e-16},
    ).x
    np.testing.assert_allclose(appendix_a.h(q, L), 0, atol=1e-16)
    assert np.linalg.norm(q - Q0) < np.linalg.norm(best - Q0) * (1 + 1e-5)
