"""Contacts between two looks: swept tests, shapes that would be passed in one step, and geometry
that is held for two frames of the graphics."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.components.contact.swept import entry
from hapticlink.components.specs.contacts import Contacts, Disc, Polygon
from hapticlink.components.specs.linkage import Body, Directions, GraphicsCopy
from tests.blocks import Running, running, virtual_environment
from tests.mechanisms import one_body

R = 0.004
CORES = {
    "point": [(0.0, 0.0)],
    "segment": [(-0.02, 0.0), (0.03, 0.01)],
    "polygon": [(-0.02, -0.01), (0.02, -0.01), (0.01, 0.02)],
}
SMALL = {
    "plate": {"polygon": (Polygon(corners=((-0.03, -0.003), (0.03, -0.003), (0.03, 0.003))),)},
    "disc": {"disc": (Disc(center=(0.0, 0.0), radius=0.02),)},
}


def distance(corners, points):
    """From points (k, 2) outside of a convex core: the smallest one from its edges."""
    corners, found = np.array(corners), []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        span = b - a
        s = np.clip((points - a) @ span / max(span @ span, 1e-300), 0, 1)
        found.append(np.linalg.norm(points - a - s[:, None] * span, axis=1))
    return np.min(found, axis=0)


@given(
    st.sampled_from(sorted(CORES)),
    st.floats(0, 2 * math.pi),
    st.floats(0, 2 * math.pi),
    st.floats(0.0, 0.3),
)
def test_a_path_meets_a_core_where_it_first_comes_within_the_radius(core, around, towards, length):
    """Against the distance at 20,001 points of the path."""
    corners = np.array(CORES[core])
    start = 0.1 * np.array([math.cos(around), math.sin(around)])
    way = length * np.array([math.cos(towards), math.sin(towards)])
    shares = np.linspace(0, 1, 20_001)
    gaps = distance(corners, start + shares[:, None] * way) - R
    found = float(entry(corners, start, way, R))
    if (gaps < -1e-6).any():
        assert found == pytest.approx(shares[np.argmax(gaps < 0)], abs=2e-4)
    elif (gaps > 1e-6).all():
        assert found > 1


class Frames:
    """A mechanism and its graphics copy: a frame reads q at its begin and publishes at its end."""

    def __init__(self, linkage, contacts, rate):
        settings = {"damping": 0.0, "detection": "graphics"} | contacts
        self.mechanism = running(linkage, settings, step_s=1 / 512)
        copy = virtual_environment(linkage, GraphicsCopy(), Directions(), Contacts(**settings))
        self.copy = Running(copy, parameters={"frame_size": 1 / rate})
        self.rate = rate

    def after(self, q, qd, time):
        """The mechanism's rates after a time (s) from q and qd."""
        mechanism, copy = self.mechanism, self.copy
        mechanism.put(q=q, qd=qd)
        copy.put(q=q, qd=qd)
        computed = copy.y["contacts"]
        frame = 0
        for tick in range(round(time * 512)):
            while frame / self.rate <= tick / 512:
                mechanism.set(contacts=computed)
                state = mechanism.state
                copy.set(q_ref=state["q"], qd_ref=state["qd"]).step(1 / self.rate)
                computed, frame = copy.y["contacts"], frame + 1
            mechanism.step(1 / 512)
        return mechanism.state["qd"]


def ball(mass, **joint):
    return one_body(Body(name="ball", mass=mass, inertia=1e-3, radius=R), **joint)


def wall(thickness):
    right = 0.3 + thickness
    corners = ((0.3, -0.1), (right, -0.1), (right, 0.1), (0.3, 0.1))
    return {"polygon": (Polygon(corners=corners),)}


@pytest.mark.parametrize("rate", [10, 30, 60])
@pytest.mark.parametrize("mass", [0.2, 1.0])
def test_a_hand_speed_comes_back_from_a_wall_seen_at_frames(rate, mass):
    """v' = -v, from any phase of the frames."""
    slide = ball(mass, type="prismatic", axis=0.0)
    for speed in (0.1, 0.3, 0.6, 1.0):
        for phase in (0.0, 0.3, 0.55, 0.8):
            start = 0.296 - 0.1 - speed * phase / rate
            time = (0.3 - start) / speed + 0.1 + 2 / rate
            back = Frames(slide, wall(0.03), rate).after(start, speed, time)
            assert back == pytest.approx(-speed, rel=2e-3)


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5, 0.75])
def test_nothing_passes_a_thick_wall_seen_at_frames(phase):
    """6 m/s, 22 mm deep in a wall of 30 mm, a frame in the middle of it for some phases."""
    slide = ball(0.2, type="prismatic", axis=0.0)
    for rate in (30, 60):
        start = 0.1 - 6.0 * phase / rate
        assert Frames(slide, wall(0.03), rate).after(start, 6.0, 0.25) == pytest.approx(-6, 2e-3)


@pytest.mark.parametrize("speed", [1.0, 2.0, 6.0])
def test_nothing_passes_a_thin_wall_in_one_step(speed):
    """A wall of 2 mm, 12 mm a step and 22 mm deep at 6 m/s, from any phase of the steps."""
    thrown = running(ball(0.2, type="prismatic", axis=0.0), {"damping": 0.0} | wall(0.002))
    for phase in np.arange(8) / 8:
        thrown.put(q=0.28 - speed * phase / 512, qd=speed)
        for _ in range(round((0.05 / speed + 0.04) * 512)):
            thrown.step(1 / 512)
        assert thrown.state["qd"] == pytest.approx(-speed, rel=2e-3)


@pytest.mark.parametrize("shape", sorted(SMALL))
@pytest.mark.parametrize("rate", [10, 30])
def test_balls_that_pass_beside_a_shape_are_left_alone_and_no_other_passes(shape, rate):
    """A straight path 1 mm beside what it would touch, and one 1 mm inside, in 8 directions."""
    frames = Frames(ball(0.5, type="free"), SMALL[shape], rate)
    for angle in np.arange(8) * math.pi / 4 + 0.1:
        along = np.array([math.cos(angle), math.sin(angle)])
        across = np.array([-along[1], along[0]])
        corners = SMALL[shape]["polygon"][0].corners if shape == "plate" else [(0.0, 0.0)]
        beside = max(np.array(corners) @ across) + R + (0.02 if shape == "disc" else 0.0)
        for off, passes in ((1e-3, True), (-1e-3, False)):
            start = (beside + off) * across - 0.15 * along
            end = frames.after([*start, 0.0], [*along, 0.0], 0.4)[:2]
            assert (np.linalg.norm(end - along) < 1e-9) == passes
            assert np.linalg.norm(end) == pytest.approx(1.0, rel=2e-2)
