"""What a run warns of: contacts past the middle of a shape, and too stiff for the steps."""

import math

import numpy as np
import pytest

from hapticlink.components.contact.broad_phase import near
from hapticlink.components.contact.depth import depths, middle, overlaps
from hapticlink.components.contact.stiffness import STABLE, poles, sticking_poles
from hapticlink.components.specs.contacts import Contacts, Disc, Polygon
from hapticlink.components.specs.linkage import Body
from tests.blocks import advance, running
from tests.components.contact import test_moving_bodies as moving
from tests.components.contact.test_contact import FLOOR, POINT, R, loose
from tests.components.contact.test_moving_bodies import disc, free

BALL = loose(POINT)  # 2 kg


def test_depths_and_the_middle_of_shapes():
    """A disc beside another, in a bar of 60 mm, an obstacle and the enclosure."""
    bar = Body(name="bar", mass=1.0, corners=((0, 0), (0.5, 0), (0.5, 0.06), (0, 0.06)))
    linkage = free(disc("ball", 1.0), disc("other", 1.0, 0.02), bar)
    contacts = Contacts(
        **FLOOR,
        disc=(Disc(center=(0.0, 0.3), radius=0.2),),
        polygon=(Polygon(corners=((1, 0), (2, 0), (2, 1), (1, 1))),),
    )
    q = [(0.2, 0.04, 0.0, 0.25, 0.04, 0.0, 0.0, 0.0, 0.0)]
    found = {(p.body, p.obstacle): (p, d[0]) for p, d in depths(linkage, contacts, q)}
    exact = {
        ("ball", "enclosure"): (0.01, math.inf),
        ("ball", "disc1"): (0.25 - math.hypot(0.2, 0.26), 0.05),
        ("ball", "polygon1"): (0.05 - 0.8, 0.05),
        ("ball", "other"): (0.07 - 0.05, 0.02),
        ("ball", "bar"): (0.05 + 0.02, 0.03),
        ("bar", "polygon1"): (-0.5, 0.03),
    }
    for key, (depth, half) in exact.items():
        pair, value = found[key]
        assert value == pytest.approx(depth, abs=1e-12), key
        assert middle(linkage, contacts, pair) == pytest.approx(half, abs=1e-12), key
    assert [p for p, _ in found.values()] == list(near(linkage, contacts))


def test_poles_of_contacts():
    """m e'' + b e' + k e = 0 at a wall, and with the reduced mass of two discs."""
    for damping in (10.0, 3000.0):
        contacts = Contacts(**FLOOR, stiffness=15000.0, damping=damping)
        found = poles(free(disc("a", 2.0), disc("b", 3.0)), contacts)
        for (_, pole), mass in zip(found, (2.0, 3.0, 1 / (1 / 2 + 1 / 3)), strict=True):
            exact = np.abs(np.roots([mass, damping, 15000.0])).max()
            assert pole == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize(("damping", "rises"), [(3900.0, False), (6000.0, True)])
def test_energy_rises_in_a_tick_only_where_the_poles_are_too_fast(damping, rises):
    """A ball of 2 kg at 1 m/s on a wall, which it meets at any part of a step of 1 ms."""
    contacts = {**FLOOR, "damping": damping}
    fastest = max(pole for _, pole in poles(BALL, Contacts(**contacts)))
    assert (fastest * 1e-3 > STABLE) == rises
    ball, most = running(BALL, contacts), 0.0
    for share in np.linspace(0, 1, 8)[:-1]:
        ball.put(q=(0.0, R + 0.002 + share * 1e-3, 0.0), qd=(0.0, -1.0, 0.0))
        energies = [1.0]
        for _ in range(20):
            ball.step(1e-3)
            energies.append(ball.outputs("energy")["energy"])
        most = max(most, np.diff(energies).max())
    assert (most > 1e-12) == rises


@pytest.mark.parametrize(("mass", "rolls"), [(0.1, True), (0.05, False)])
def test_a_light_disc_rolls_without_slip_only_where_sticking_is_slow_enough(mass, rolls):
    """A force of 0.2 m g at its centre; mobility 1/m + r^2/I = 3/m along the floor, b = 4 h k."""
    h, radius, k = 1e-3, 0.01, 15000.0
    puck = disc("puck", mass, radius)
    linkage = free(puck, gravity=(0.0, -9.81), start={"puck": (0.0, radius, 0.0)})
    law = {"friction": 0.5, "damping": 5.0, **moving.FLOOR}
    ((_, pole),) = sticking_poles(linkage, Contacts(**law), h)
    exact = np.roots([mass / 3, 4 * h * k, k])
    assert pole == pytest.approx(np.abs(exact).max(), rel=1e-9)
    assert (pole * h < STABLE) == rolls
    assert next(poles(linkage, Contacts(**law)))[1] * h < 1
    found, slip = moving.block(linkage, law), 0.0
    found.set(F_hand=(0.2 * mass * 9.81, 0.0, 0.0))
    advance(found, 0.8, 1000)
    for _ in range(100):
        found.step(h)
        slip = max(slip, abs(found.state["qd"] @ (1.0, 0.0, radius)))
    assert (slip < 1e-9) == rolls


def test_shapes_that_cross_with_no_corner_inside_overlap():
    """Bars of 0.2 m by 40 mm, a cross: parted by half of both sizes; a rounded segment likewise."""
    sides = ((-0.1, -0.02), (0.1, -0.02), (0.1, 0.02), (-0.1, 0.02))
    lying, standing = (Body(name=name, mass=1.0, corners=sides) for name in "ab")
    axis = Body(name="c", mass=1.0, radius=0.01, capsule=((-0.1, 0.0), (0.1, 0.0)))
    linkage, contacts = free(lying, standing, axis), Contacts()
    q = np.array([(0, 0, 0, 0.03, 0, math.pi / 2, 0.05, 0.0, math.pi / 2)] * 2)
    q[1, [4, 7]] = 0.13  # above the lying one
    found = {p.body + p.obstacle: d for p, d in overlaps(linkage, contacts, q)}
    np.testing.assert_allclose(found["ab"], (0.09 + 0.0, -math.inf), atol=1e-12)
    np.testing.assert_allclose(found["ac"], (0.05 + 0.01, -math.inf), atol=1e-12)
    gaps = {p.body + p.obstacle: d for p, d in depths(linkage, contacts, q[:1])}
    assert gaps["ab"] < 0  # no corner is inside
