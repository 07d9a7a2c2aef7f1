"""L-stability of the linearly implicit method on a stiff joint, where explicit methods diverge."""

import casadi as ca
import numpy as np
import pytest

from hapticlink.components.integrators import step
from hapticlink.components.integrators.linearly_implicit import GAMMA
from hapticlink.components.specs.linkage import Body
from tests.blocks import advance, running
from tests.mechanisms import one_body


def after(integrator, steps, stiffness, damping):
    """Angle of a 1 kg m2 disc, from 0.1 rad towards its rest at 0.2, at 512 Hz."""
    spring = {"stiffness": stiffness, "damping": damping, "rest": 0.2}
    linkage = one_body(Body(name="disc", mass=1.0, inertia=1.0), start=0.1, **spring)
    with np.errstate(all="ignore"):
        return advance(running(linkage, integrator=integrator), steps / 512, 512).state["q"][0]


@pytest.mark.parametrize(("stiffness", "damping"), [(1e10, None), (1e8, 1e5), (1e6, 1e9)])
def test_stiff_modes_die_out_within_steps(stiffness, damping):
    """R(z) -> 0 for z -> infinity: undamped, oscillating and creeping springs alike."""
    left = after("linearly-implicit", 12, stiffness, damping) - 0.2
    # A spring that creeps (rate K/B = 1e-3/s) must stay where it is instead.
    goal = -0.1 * np.exp(-1e-3 * 12 / 512) if damping == 1e9 else 0.0
    assert left == pytest.approx(goal, abs=1e-6)


def test_explicit_methods_do_not_hold_it():
    assert not abs(after("rk4", 40, 1e8, 1e5)) < 1


def stepped(n):
    """(x, u, p, t) -> x' of two masses that n springs which slip hold, as friction of contacts, and
    a step of it."""
    sizes = {"x": 4 + n, "u": 0, "p": 0, "t": 1, "h": 1}
    x, u, p, t, _ = arguments = [ca.SX.sym(name, size) for name, size in sizes.items()]
    q, v, z = x[:2], x[2:4], x[4:]
    rates = [v[i % 2] * ca.cos(q[0]) - (1 + i) * z[i] * v[1] ** 2 for i in range(n)]
    pulls = [-sum((40 * z[i] for i in range(k, n, 2)), start=30 * ca.sin(q[k])) for k in range(2)]
    f = ca.Function("f", [x, u, p, t], [ca.vertcat(v, *pulls, *rates)])
    after = step("linearly-implicit", f, *arguments, range(2))
    return f, ca.Function("after", arguments, [after], {"cse": True})


def test_a_step_is_the_formula_of_its_reference_with_the_whole_matrix():
    """(1 - gamma h J) k_1 = f(x),  (1 - gamma h J) k_2 = f(x + h k_1) - 2 k_1, by NumPy."""
    f, after = stepped(5)
    x, h = np.random.default_rng(1).normal(size=9), 0.05
    J = ca.Function("J", f.sx_in(), [ca.jacobian(f(*f.sx_in()), f.sx_in()[0])])
    A = np.eye(9) - GAMMA * h * np.array(J(x, [], [], 0))
    k1 = np.linalg.solve(A, np.array(f(x, [], [], 0)).ravel())
    k2 = np.linalg.solve(A, np.array(f(x + h * k1, [], [], h)).ravel() - 2 * k1)
    expected = x + h * (1.5 * k1 + 0.5 * k2)
    np.testing.assert_allclose(np.array(after(x, [], [], 0, h)).ravel(), expected, rtol=1e-12)


def test_operations_grow_with_the_number_of_springs_that_slip_and_not_with_its_cube():
    count = {n: stepped(n)[1].n_instructions() for n in (20, 40, 80)}
    assert count[80] - count[40] < 2.1 * (count[40] - count[20])
