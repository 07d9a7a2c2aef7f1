"""Friction of contacts against closed forms: sticking, sliding, rolling; what the hand feels."""

import math

import numpy as np
import pytest

from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Body, Directions, GraphicsCopy
from tests import blocks
from tests.blocks import RATES, Running, advance, order, virtual_environment
from tests.components.contact import piecewise
from tests.mechanisms import one_body

MASS, INERTIA, G, R, LENGTH, K = 2.0, 0.03, 9.81, 0.05, 0.4, 15000.0
FLOOR = ((-50.0, 0.0), (50.0, 0.0), (50.0, 5.0), (-50.0, 5.0))


def body(capsule, slope, inertia=INERTIA, speed=0.0):
    """A capsule in touch with a floor on which gravity acts at an angle."""
    center = tuple(np.mean(capsule, axis=0))
    bar = Body(name="bar", mass=MASS, inertia=inertia, center=center, radius=R, capsule=capsule)
    field = (G * math.sin(slope), -G * math.cos(slope))
    start, rate = (0.0, R, 0.0), (speed, 0.0, 0.0)
    return one_body(bar, at=center, start=start, rate=rate, gravity=field, type="free")


BAR, DISC = ((0.0, 0.0), (LENGTH, 0.0)), ((0.0, 0.0),)


def running(linkage, friction, events=1, integrator="rk4", **contacts):
    contacts |= {"enclosure": FLOOR, "friction": friction}
    return blocks.running(linkage, contacts, step_s=2e-3, events=events, integrator=integrator)


def test_a_bar_below_the_friction_angle_stays_for_a_minute_and_is_felt():
    """tan(slope) = .42 against .5: once it has settled on its springs it does not creep, and its
    contacts bear the whole weight, along the floor too."""
    bar = advance(running(body(BAR, 0.4), 0.5), 5.0)
    before = bar.state["q"]
    assert bar.y["x"][1] == pytest.approx(R - MASS * G * math.cos(0.4) / (2 * K), abs=1e-9)
    weight = MASS * G * np.array([math.sin(0.4), -math.cos(0.4), 0.0])
    np.testing.assert_allclose(bar.y["F_env"], -weight, atol=1e-6)
    for _ in range(60):
        assert np.abs(advance(bar, 1.0).state["q"] - before).max() < 1e-9


@pytest.mark.parametrize("integrator", ["rk4", "passive-midpoint"])
@pytest.mark.parametrize(("slope", "friction"), [(0.6, 0.4), (0.3, 0.25)])
def test_a_bar_above_the_friction_angle_slides(integrator, slope, friction):
    """a = g (sin - mu cos)."""
    bar = advance(running(body(BAR, slope), friction, integrator=integrator), 2.0)
    before = bar.state["qd"][0]
    a = G * (math.sin(slope) - friction * math.cos(slope))
    assert advance(bar, 1.0).state["qd"][0] - before == pytest.approx(a, rel=1e-6)


def test_passive_midpoint_has_order_two_while_a_pressed_bar_slides():
    """A bar that sits deeper than at rest rocks on both ends while it slides, at no time out of
    touch or sticking, so that friction is a smooth function of the pressure."""
    mu, depth = 0.4, MASS * G / (2 * K)

    def end(integrator, rate):
        bar = running(body(BAR, 0.3), mu, integrator=integrator, damping=60.0)
        z = np.full_like(bar.state["contact_deflection"], -mu * depth)
        bar.put(q=(0.0, R - 1.3 * depth, 1e-4), qd=(5.0, 0.0, 0.0), contact_deflection=z)
        return advance(bar, 0.05, rate).x[:6]

    exact = end("rk4", 16000)
    assert order([np.abs(end("passive-midpoint", rate) - exact).max() for rate in RATES]) > 1.8


@pytest.mark.parametrize(("friction", "slips"), [(0.5, False), (0.1, True)])
def test_a_disc_rolls_or_slips_down_a_slope(friction, slips):
    """a = g sin/(1 + I/(m r^2)) where friction can hold the rim, g (sin - mu cos) where not."""
    inertia = 0.5 * MASS * R**2
    disc = advance(running(body(DISC, 0.5, inertia), friction), 2.0)
    before = disc.state["qd"]
    change = advance(disc, 1.0).state["qd"] - before
    a = G * math.sin(0.5) / 1.5
    turned = -a / R
    if slips:
        a = G * (math.sin(0.5) - friction * math.cos(0.5))
        turned = -friction * MASS * G * math.cos(0.5) * R / inertia
    assert change[0] == pytest.approx(a, rel=1e-5)
    assert change[2] == pytest.approx(turned, rel=1e-5)


def test_a_thrown_bar_stops_where_its_energy_is_spent():
    """x = v^2/(2 mu g)."""
    bar = advance(running(body(BAR, 0.0, speed=1.0), 0.3), 2.0)
    assert bar.state["q"][0] == pytest.approx(1 / (2 * 0.3 * G), abs=1e-3)
    assert np.abs(bar.state["qd"]).max() < 1e-6


def test_geometry_of_the_graphics_block_gives_the_same_friction():
    linkage = body(BAR, 0.4)
    here, held = running(linkage, 0.5), running(linkage, 0.5, detection="graphics")
    contacts = Contacts(enclosure=FLOOR, friction=0.5, margin=10.0)
    copy = Running(virtual_environment(linkage, GraphicsCopy(), Directions(), contacts))
    pose = {"q": (0.1, R - 1e-3, 1e-4), "qd": (0.2, 0.1, -0.3)}
    deflection = np.linspace(-1e-4, 1e-4, here.state["contact_deflection"].size)
    for block in (here, held):
        block.put(**pose, contact_deflection=deflection)
    copy.put(**pose)
    held.set(contacts=copy.y["contacts"])
    assert abs(here.y["F_env"][0]) > 1.0
    np.testing.assert_allclose(held.y["F_env"], here.y["F_env"], rtol=1e-12)
    advance(here, 0.01)
    advance(held, 0.01)
    np.testing.assert_allclose(held.x, here.x, atol=1e-12)


def test_an_impact_with_friction_has_the_order_of_the_method():
    """A bar that bounces on its ends while it slides, against SciPy from event to event. Its ends
    let go .2 ms one after the other."""
    mu, b, t_end = 0.2, 60.0, 0.06

    def arm(theta, side):
        return side * LENGTH / 2 * np.array([math.cos(theta), math.sin(theta)])

    def rhs(y, push):
        alpha = 0.0
        for side, N in zip((-1, 1), push, strict=True):
            x, height = arm(y[2], side)
            alpha += (x * N + mu * N * (height - R)) / INERTIA
        total = push.sum() / MASS
        return np.array([*y[3:], -mu * total, total - G, alpha])

    def end(side):
        def gap(y):
            x, height = arm(y[2], side)
            return y[1] + height - R, y[4] + x * y[5], K, b

        return gap

    start = np.array([0.2, R + 0.0123, 0.0, 3.0, -1.0, 0.0])
    exact, events = piecewise.solve(rhs, [end(-1), end(1)], start, t_end)
    assert events == 4
    errors = []
    for rate in RATES:
        bar = running(body(BAR, 0.0), mu, events=2, damping=b)
        bar.put(q=(0.0, R + 0.0123, 0.0), qd=start[3:])
        y = advance(bar, t_end, rate).y
        errors.append(np.abs(np.r_[y["x"], y["v"]] - exact).max())
    assert order(errors) > 3.5
    assert errors[1] < 1e-4


def test_a_change_from_sliding_to_sticking_is_of_second_order():
    """A block on a rail that a floor presses by N: it slides with v' = -mu N/m until v = 0, where
    its spring is deflected by d = mu N/k, and goes on as m z'' + k tau z' + k z = 0, z(0) = d,
    z' = v. The force has no jump there, and such changes are not located."""
    N, mu, speed, t_end = 19.62, 0.3, 0.5, 0.25
    body = Body(name="bar", mass=MASS, inertia=1.0, radius=R)
    block = one_body(body, rate=speed, type="prismatic", axis=0.0, at_parent=(0.0, R - N / K))
    t = t_end - speed * MASS / (mu * N)
    omega, d, tau = math.sqrt(K / MASS), mu * N / K, 4 * 2e-3  # of steps of 2 ms (`running`)
    zeta = tau * omega / 2
    damped = omega * math.sqrt(1 - zeta**2)
    exact = -d * omega**2 / damped * math.exp(-zeta * omega * t) * math.sin(damped * t)
    rates = (*RATES, 8000)
    errors = [
        abs(advance(running(block, mu), t_end, rate).state["qd"][0] - exact) for rate in rates
    ]
    assert 1.7 < order(errors, rates) < 2.5
    assert errors[1] < 5e-6
