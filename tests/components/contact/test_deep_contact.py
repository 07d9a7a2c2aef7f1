"""Links that penetrate deeper than their radius are pushed back and keep their energy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.components.specs.contacts import Contacts, Disc, Polygon
from hapticlink.components.specs.linkage import Body, Directions, GraphicsCopy
from tests.blocks import Running, once, running, virtual_environment
from tests.components.contact.test_contact import BAR, LENGTH, SQUARE, R
from tests.mechanisms import one_body

MASS, INERTIA = 2.0, 0.03
SPIKE = ((-0.06, -0.3), (0.06, -0.3), (0.02, 0.0))


@once
def loose(corners, **law):
    """A free bar by a polygon."""
    middle = (LENGTH / 2, 0.0) if law else None
    bar = Body(name="bar", mass=MASS, inertia=INERTIA, center=middle, radius=R, capsule=BAR)
    contacts = {"polygon": (Polygon(corners=corners),), "damping": 0.0} | law
    return running(one_body(bar, type="free"), contacts)


def farthest_axis(corners, ends):
    """Largest distance of a segment from a convex polygon along any of their normals, negative
    where they overlap: the way out (separating axes)."""
    corners, (a, b) = np.array(corners), ends
    turn = np.array([[0, -1], [1, 0]])
    heights = (a - corners) @ turn @ (b - a) / np.linalg.norm(b - a)
    found = [heights.min(), -heights.max()]
    for corner, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        outward = turn.T @ (following - corner) / np.linalg.norm(following - corner)
        found.append(min((a - corner) @ outward, (b - corner) @ outward))
    return max(found)


@given(st.floats(-0.4, 0.7), st.floats(-0.4, 0.6), st.floats(-math.pi, math.pi))
def test_an_axis_inside_is_pushed_out_by_no_more_than_the_way_out(x, y, angle):
    along = np.array([math.cos(angle), math.sin(angle)])
    way = farthest_axis(SQUARE, (np.array([x, y]), np.array([x, y]) + LENGTH * along))
    bar = loose(SQUARE)
    bar.put(q=(x, y, angle))
    if way < -1e-9:
        assert way - R - 1e-12 <= bar.y["contact_gap"] <= -R


@given(st.floats(0.3, 0.7), st.floats(-0.4, 0.4), st.floats(-0.08, 0.06))
def test_a_corner_pushes_out_a_bar_that_sank_in_past_its_axis(share, angle, height):
    """Both sides of the axis on the corner: F = k (r - height) along the bar's normal."""
    along, normal = (math.cos(angle), math.sin(angle)), (-math.sin(angle), math.cos(angle))
    start = np.array(SPIKE[2]) + height * np.array(normal) - share * LENGTH * np.array(along)
    bar = loose(SPIKE)
    bar.put(q=(*start, angle))
    push = 15000.0 * max(0.0, R - height)
    exact = (*(push * np.array(normal) / MASS), push * share * LENGTH / INERTIA)
    assert bar.y["contact_gap"] == pytest.approx(height - R, abs=1e-12)
    np.testing.assert_allclose(bar.y["qdd"], exact, rtol=1e-9, atol=1e-8)


def dropped(obstacle, detection, speed):
    """A bar of 1 kg and r = 5 mm that slides down onto the obstacle 20 mm under its axis."""
    bar = Body(name="bar", mass=1.0, inertia=0.01, radius=0.005, capsule=((-0.1, 0.0), (0.1, 0.0)))
    linkage = one_body(bar, type="prismatic", axis=-math.pi / 2)
    contacts = obstacle | {"damping": 0.0, "detection": detection, "margin": 0.1}
    falling = running(linkage, contacts, step_s=1e-4).put(qd=speed)
    if detection == "haptics":
        return falling, None
    copy = virtual_environment(linkage, GraphicsCopy(), Directions(), Contacts(**contacts))
    return falling, Running(copy)


WEDGE = ((-0.02, -0.1), (0.02, -0.1), (0.0, -0.02))
TABLE = ((-0.2, -0.1), (0.2, -0.1), (0.2, -0.02), (-0.2, -0.02))
OBSTACLES = {
    "corner": {"polygon": (Polygon(corners=WEDGE),)},
    "edge": {"polygon": (Polygon(corners=TABLE),)},
    "disc": {"disc": (Disc(center=(0.0, -0.06), radius=0.04),)},
}


@pytest.mark.parametrize(
    ("speed", "detection"),
    [(0.5, "haptics"), (1.0, "haptics"), (3.0, "haptics"), (3.0, "graphics")],
)
@pytest.mark.parametrize("obstacle", OBSTACLES)
def test_an_elastic_bounce_deeper_than_the_radius_returns_its_energy(obstacle, speed, detection):
    """Depth v sqrt(m/k) of a spring, k for each place; at 1 m/s past the axis on a corner."""
    bar, copy = dropped(OBSTACLES[obstacle], detection, speed)
    energy, deepest = 0.5 * speed**2, 0.0
    for tick in range(round((0.03 / speed + math.pi / math.sqrt(15000.0)) / 1e-4)):
        if copy and tick % 160 == 0:  # 62.5 Hz
            copy.put(q=bar.state["q"])
            bar.set(contacts=copy.y["contacts"])
        bar.step(1e-4)
        deepest = max(deepest, -bar.y["contact_gap"])
        assert bar.y["energy"] == pytest.approx(energy, rel=1e-4)
    places = 2 if obstacle == "edge" else 1
    assert deepest == pytest.approx(speed / math.sqrt(places * 15000.0), rel=1e-3)
    assert bar.y["qd"][0] == pytest.approx(-speed, rel=1e-3)


@pytest.mark.parametrize(
    ("q", "qd"),
    [
        ((-0.2769, 0.3536, 2.4271), (1.9605, -0.3273, 3.4602)),
        ((1.0246, -0.2655, 0.873), (-2.0242, 0.7753, -0.3238)),
    ],
)
def test_a_corner_that_passes_an_end_while_pressed_adds_no_energy(q, qd):
    """Bars on a soft square without damping; at a radius' depth a spring of k r^2/2 = 2.5 J."""
    bar = loose(SQUARE, stiffness=2000.0)
    bar.put(q=q, qd=qd)
    before, deepest = bar.y["energy"], 0.0
    for _ in range(1400):
        bar.step(5e-4)
        y = bar.outputs("energy", "contact_gap")
        deepest = max(deepest, -y["contact_gap"])
        assert y["energy"] == pytest.approx(before, rel=1e-4)
    assert deepest > 0.5 * R
