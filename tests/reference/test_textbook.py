"""A textbook's linkages: with slots and gears, against the geometry that each is known for, and
against an integration in absolute coordinates."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hapticlink.components.specs.linkage import Loop
from hapticlink.orchestrator import open_scene
from tests.blocks import advance, running
from tests.reference.absolute_coordinates import Absolute

H = 1 / 512
SLOTS = ("trammel", "scotch-yoke", "quick-return", "scissor-lift")
PINS = ("peaucellier", "watt-six-bar", "six-bar", "jansen", "pantograph", "geared-five-bar")
DRIVEN = ("quick-return", "jansen", "six-bar")


def linkage(name):
    return open_scene.load(name).linkage


def undriven(name):
    """The linkage without its servo, with 3 rad/s of the crank instead."""
    found = linkage(name)
    joints = tuple(replace(j, drive=None) for j in found.joint)
    start = {"crank": 3.0} if name in DRIVEN else found.start_velocity
    return replace(found, joint=joints, start_velocity=start)


def motion(name, t_end):
    block = running(linkage(name), step_s=H)
    for _ in range(round(t_end / H)):
        block.step(H)
        yield block.y


def circles(a, ra, b, rb, side):
    """The intersection of two circles, on the left of a to b for side = 1."""
    a, b = np.asarray(a), np.asarray(b)
    along = (b - a) / np.linalg.norm(b - a)
    x = (np.linalg.norm(b - a) ** 2 + ra**2 - rb**2) / (2 * np.linalg.norm(b - a))
    return a + x * along + side * math.sqrt(ra**2 - x**2) * np.array([-along[1], along[0]])


def polar(r, angle):
    return r * np.array([math.cos(angle), math.sin(angle)])


@pytest.mark.parametrize("name", [*SLOTS, *PINS])
def test_motion_is_that_in_absolute_coordinates(name):
    found = undriven(name)
    block = running(found, step_s=H, integrator="dormand-prince-8")
    q0, qd0, begin = block.y["q"], block.y["qd"], float(block.y["energy"])
    advance(block, 128 * H, 512)
    q, gained = Absolute(found, q0, qd0).joints(128 * H)
    assert abs(gained) < 1e-10
    assert np.abs(block.y["q"] - q0).max() > 0.05
    assert block.y["q"] == pytest.approx(q, abs=2e-10)
    assert float(block.y["energy"]) == pytest.approx(begin, abs=1e-10)


def test_scotch_yoke_is_a_sine():
    for y in motion("scotch-yoke", 1.0):
        assert y["x"][0] == pytest.approx(0.05 * math.cos(y["q"][0]), abs=1e-12)


def test_quick_return_goes_back_faster_than_forth():
    """The crank turns by pi + 2 beta forth and pi - 2 beta back, sin(beta) = r/c."""
    ram, crank = [], []
    for y in motion("quick-return", 2.0):
        lever = math.atan2(0.1 + 0.04 * math.sin(y["q"][0]), 0.04 * math.cos(y["q"][0]))
        assert y["q"][1] == pytest.approx(lever, abs=1e-12)
        assert y["x"][0] == pytest.approx(0.2 / math.tan(lever), abs=1e-12)
        ram.append(y["x"][0])
        crank.append(y["q"][0])
    turning = [c for a, b, d, c in zip(ram, ram[1:], ram[2:], crank[1:], strict=False)
               if (b - a) * (d - b) < 0]  # fmt: skip
    beta = math.asin(0.04 / 0.1)
    assert turning[1] - turning[0] in (
        pytest.approx(math.pi - 2 * beta, abs=0.05), pytest.approx(math.pi + 2 * beta, abs=0.05)
    )  # fmt: skip
    assert turning[2] - turning[0] == pytest.approx(2 * math.pi, abs=0.05)


def test_peaucellier_draws_a_straight_line():
    """|AC| |AP| = l^2 - s^2: the circle through the pivot becomes a line."""
    y = [y["x"][:2] for y in motion("peaucellier", 2.0)]
    x, across = np.transpose(y)
    assert x == pytest.approx((0.12**2 - 0.08**2) / (2 * 0.04), abs=1e-11)
    assert np.ptp(across) > 0.08


def test_watt_closes_as_two_pairs_of_circles():
    for y in motion("watt-six-bar", 0.5):
        crank, wrist, rocker = y["q"][:3]
        tip = polar(0.04, crank)
        elbow = circles(tip, 0.12, [0.1, 0.0], 0.09, 1)
        coupler, own = elbow - tip, elbow - [0.1, 0.0]
        coupler, own = math.atan2(*coupler[::-1]), math.atan2(*own[::-1])
        assert np.exp(1j * (crank + wrist)) == pytest.approx(np.exp(1j * coupler), abs=1e-10)
        assert np.exp(1j * rocker) == pytest.approx(np.exp(1j * own), abs=1e-10)
        on_coupler = tip + polar(math.hypot(0.06, 0.05), coupler + math.atan2(0.05, 0.06))
        on_rocker = np.array([0.1, 0.0]) + polar(
            math.hypot(0.06, 0.05), own + math.atan2(-0.05, 0.06)
        )
        assert y["x"][:2] == pytest.approx(circles(on_coupler, 0.08, on_rocker, 0.09, 1), abs=1e-10)


def test_jansens_foot_goes_as_its_lengths_say():
    """Lengths in mm by their letters: T. Jansen, The Great Pretender (2007)."""
    a, b, c, d, e, f, g, h, i, j, k, l, m = np.array(  # noqa: E741
        [38, 41.5, 39.3, 40.1, 55.8, 39.4, 36.7, 65.7, 49, 50, 61.9, 7.8, 15]
    ) * 1e-3  # fmt: skip
    feet, pivot = [], np.array([-a, -l])
    for y in motion("jansen", 1.2):
        crank = polar(m, y["q"][0])
        top, bottom = circles(pivot, b, crank, j, 1), circles(pivot, c, crank, k, -1)
        ankle = circles(circles(pivot, d, top, e, 1), f, bottom, g, -1)
        foot = circles(bottom, i, ankle, h, 1)
        assert y["x"][:2] == pytest.approx(foot, abs=1e-9)
        feet.append(foot)
    height = np.transpose(feet)[1]
    assert np.mean(height < height.min() + 3e-3) > 0.4  # flat on the ground


def test_pantograph_doubles():
    for y in motion("pantograph", 1.0):
        assert y["pen.x"][:2] == pytest.approx(2 * y["x"][:2], abs=1e-12)


def test_scissor_lift_stays_level():
    for y in motion("scissor-lift", 1.0):
        angle = y["q"][0]
        where = [0.1 * math.cos(0.5), 2 * 0.2 * math.sin(angle), 0.0]
        assert y["x"] == pytest.approx(where, abs=1e-12)


def test_geared_five_bar_meets_where_two_circles_do():
    for y in motion("geared-five-bar", 1.0):
        driver, driven = y["q"][0], y["q"][2]
        assert driver - 1.2 == pytest.approx(-2 * (driven - 2.0), abs=1e-12)
        ends = polar(0.04, driver), np.array([0.12, 0.0]) + polar(0.05, driven)
        meets = [circles(ends[0], 0.11, ends[1], 0.12, side) for side in (1, -1)]
        assert min(np.abs(y["x"][:2] - meet).max() for meet in meets) < 1e-11


def test_a_cut_slide_moves_as_one_in_the_tree():
    """The slider-crank with its slide cut instead of its pin, without friction on the slide."""
    tree = linkage("slider-crank")
    smooth = (replace(j, damping=None, friction=None) for j in tree.joint)
    tree = replace(tree, joint=tuple(smooth))
    slide = next(j for j in tree.joint if j.type == "prismatic")
    (loop,) = tree.loop
    pin = next(i for i, body in enumerate(loop.bodies) if body == slide.child)
    joints = tuple(
        replace(
            j, type="revolute", parent=loop.bodies[1 - pin], at_parent=loop.at[1 - pin],
            at_child=loop.at[pin], axis=None,
        )
        if j is slide else j
        for j in tree.joint
    )  # fmt: skip
    exact = {"integrator": "dormand-prince-8", "step_s": H}
    blocks = [running(tree, **exact)]
    q = dict(zip((j.name for j in tree.joint), blocks[0].y["q"], strict=True))
    start = {name: float(value) for name, value in q.items() if name != slide.name}
    start[slide.name] = -sum(start.values())  # the slider stays level
    cut = Loop(
        type="prismatic", bodies=(slide.child, "ground"), axis=slide.axis,
        at=((0.0, 0.0), slide.at_parent or (0.0, 0.0)),
    )  # fmt: skip
    blocks.append(running(replace(tree, joint=joints, loop=(cut,), start=start), **exact))
    for _ in range(512):
        for block in blocks:
            block.step(H)
        assert blocks[1].y["x"] == pytest.approx(blocks[0].y["x"], abs=1e-10)
