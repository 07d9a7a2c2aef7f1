"""Light and massless bodies in loops, against one equation in SciPy and 60 digits in mpmath."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import tests.components.dynamics.extended_precision as exact
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.specs.linkage import (
    Body,
    Directions,
    GraphicsCopy,
    Joint,
    Linkage,
    Loop,
    OperationalPoint,
)
from tests.blocks import Running, advance, running, virtual_environment
from tests.mechanisms import evaluated, four_bar, linkages, rod

G, RATE = 9.81, 1000


def trammel(sliders, turn=0.0, start=math.pi / 3):
    """A rod of 1 m and 1 kg between two sliders (kg) on lines at right angles, turned as a whole;
    `start` is the angle of the rod's middle about the crossing."""
    c, s = math.cos(turn), math.sin(turn)
    slider = {"mass": sliders, "inertia": 0.0}
    return Linkage(
        body=(
            Body(name="slider_x", **slider),
            rod("rod", 1.0),
            Body(name="slider_y", **slider),
        ),
        joint=(
            Joint(name="x", type="prismatic", child="slider_x", axis=turn),
            Joint(name="pin", parent="slider_x", child="rod"),
            Joint(name="y", type="prismatic", child="slider_y", axis=turn + math.pi / 2),
        ),
        loop=(Loop(bodies=("rod", "slider_y"), at=((1.0, 0.0), (0.0, 0.0))),),
        gravity=(G * s, -G * c),
        operational_point=OperationalPoint(body="rod", at=(0.5, 0.0)),
        start={"x": math.cos(start), "pin": turn + math.pi - start, "y": math.sin(start)},
    )


def pendulum(sliders, t_end, start=math.pi / 3):
    """(angle, rate) of the rod's middle: (m/4 + I + m_s) angle'' = -(m/2 + m_s) g cos angle."""
    pull, inertia = 0.5 + sliders, 1 / 4 + 1 / 12 + sliders

    def f(_, y):
        return y[1], -pull * G * math.cos(y[0]) / inertia

    return solve_ivp(f, (0, t_end), (start, 0), "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]


@pytest.mark.parametrize(
    ("sliders", "turn"),
    [(1.0, 0.5), (1e-2, 0.5), (1e-4, 0.5), (1e-7, 0.5), (1e-12, 0.5), (0.0, 0.5), (0.0, 0.0)],
)
def test_trammel_with_sliders_of_any_mass(sliders, turn):
    block = running(trammel(sliders, turn))
    begin, change = block.y["energy"], 0.0
    for k in range(3 * RATE):
        block.step(1 / RATE)
        if k % 50 == 0:
            change = max(change, abs(block.y["energy"] - begin))
    angle, rate = pendulum(sliders, 3.0)
    middle = 0.5 * np.array([math.cos(angle + turn), math.sin(angle + turn)])
    np.testing.assert_allclose(block.y["x"][:2], middle, rtol=0, atol=1e-11)
    assert change < 1e-9
    # Gravity, the centripetal force and the tangential one are all that the guides and the rod's
    # inertia leave: the force of the cut pin along its guide moves the slider alone.
    along = np.array([-math.sin(turn), math.cos(turn)])
    pull, inertia = 0.5 + sliders, 1 / 4 + 1 / 12 + sliders
    turned = -pull * G * math.cos(angle) / inertia
    lift = math.cos(angle) * turned - math.sin(angle) * rate**2
    force = sliders * (lift + G)
    assert abs(along @ block.y["lambda"]) == pytest.approx(abs(force), rel=1e-7, abs=1e-9)


def test_massless_sliders_leave_the_mobility_of_a_rod_on_its_circle():
    """Lambda^-1 = J J'/(m/4 + I) with the one column of motion of the rod's middle."""
    block = running(trammel(0.0), directions=Directions())
    motion = np.array([-0.5 * math.sin(math.pi / 3), 0.5 * math.cos(math.pi / 3), -1.0])
    mobility = np.outer(motion, motion) / (1 / 4 + 1 / 12)
    np.testing.assert_allclose(block.y["Lambda_inv"], mobility, atol=1e-13)
    assert block.y["n_constraints"] == 2


def test_the_graphics_copy_has_massless_bodies_too():
    copy = virtual_environment(trammel(0.0), GraphicsCopy(), Directions(), local_model=True)
    block = Running(copy)
    held, own = running(trammel(0.0), frame_s=1 / 30), running(trammel(0.0))
    held.set(**{name: block.y[name] for name in ("D", "W", "w", "J_h")})
    for name in ("qdd", "lambda", "a_bias"):
        np.testing.assert_allclose(held.y[name], own.y[name], rtol=1e-10, atol=1e-10)


@st.composite
def spread(draw):
    """A random linkage, its masses and inertias each times 1e-12 to 1."""
    linkage, q, qd = draw(linkages(max_bodies=6, max_loops=2))
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    body = tuple(
        replace(b, mass=b.mass * 10 ** rng.uniform(-12, 0), inertia=b.inertia * 10**i)
        for b, i in zip(linkage.body, rng.uniform(-12, 0, len(linkage.body)), strict=True)
    )
    return replace(linkage, body=body), q, qd, rng


@settings(max_examples=20)
@given(spread())
def test_random_linkages_are_as_exact_as_their_last_digits(drawn):
    """The error is within 1000 times of what a change of every length, angle, rate, mass and
    force in its last place makes of the exact solution; each in the largest entry. The recursion
    over the tree takes m r^2 from I + m r^2: where I is 1e-12 of it, 1e-11 of an entry may go."""
    linkage, q, qd, rng = drawn
    F = rng.normal(size=3)
    given_numbers = exact.numbers(linkage, q, qd, F)
    solution = exact.solution(linkage, given_numbers)
    near = [exact.solution(linkage, exact.disturbed(given_numbers, rng)) for _ in range(3)]

    def ours(model, F):
        space = OperationalSpace(model)
        return *space.motion(model.J_h.T @ F), space.Lambda_inv

    for k, mine in enumerate(evaluated(linkage, ours, (3,))(q, qd, F)):
        right = solution[k]
        error = np.abs(mine.reshape(right.shape) - right).max(initial=0)
        inherent = max(np.abs(other[k] - right).max(initial=0) for other in near)
        assert error <= 1000 * inherent + 1e-11 * np.abs(right).max(initial=0)


def test_massless_coupler_is_the_limit_of_light_ones():
    massless, light = (
        advance(running(four_bar((1.0, mass, 1.0)), integrator="dormand-prince-8"), 0.5, RATE)
        for mass in (0.0, 1e-13)
    )
    np.testing.assert_allclose(massless.x, light.x, rtol=0, atol=1e-9)
    assert light.y["closure_error"] < 1e-14


def test_a_dead_centre_that_nothing_with_mass_carries_ends_the_run_by_name():
    """The rocker comes to its end with speed, the massless crank would have to turn infinitely
    fast: energy is kept until then, and a state of the crank or coupler is no number after."""
    block = running(four_bar((0.0, 0.0, 1.0), rate=3.0))
    assert "massless body `crank`" in block.component.state_texts[0]
    begin = block.y["energy"]
    while np.isfinite(block.x).all():
        assert block.y["energy"] == pytest.approx(begin, abs=0.1)
        block.step(1 / RATE)
        assert block.t < 3
    assert not np.isfinite(block.state["q"][:2]).all()
