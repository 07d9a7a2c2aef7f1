"""The shipped linkages against the geometry and the equations that each is known for."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hapticlink.orchestrator import open_scene
from tests.blocks import Running, virtual_mechanism

H = 1 / 512


def running(name, *options):
    scene = open_scene.load(name, options)
    return Running(virtual_mechanism(scene.linkage, scene.mechanism, step_s=H))


def motion(block, t_end):
    """The outputs after each step."""
    for _ in range(round(t_end / H)):
        block.step(H)
        yield block.y


def test_pendulum_swings_and_rubs_by_coulombs_law():
    """I q'' = -m g l cos q - b q' - f sign q', solved from turn to turn."""

    def turn(_, y, sign):
        return y[1]

    turn.terminal = True
    t, y, sign = 0.0, np.array([1 - math.pi / 2, 0.0]), -1
    while t < 2:

        def f(_, y, sign):
            return y[1], 3 * (-9.81 * 0.5 * math.cos(y[0]) - 0.01 * y[1] - 0.02 * sign)

        turn.direction = -sign
        options = {"events": turn, "rtol": 1e-12, "atol": 1e-14, "args": (sign,)}
        found = solve_ivp(f, (t, 2), y, "DOP853", **options)
        t, y, sign = found.t[-1], found.y[:, -1], -sign
    block = running("pendulum")
    *_, last = motion(block, 2.0)
    deflection = 16 * 0.02 * 3 * H**2
    assert last["q"] == pytest.approx(y[0], abs=deflection)


def test_four_bar_keeps_freudensteins_equation_under_its_servo():
    """k1 cos(rocker) - k2 cos(crank) + k3 = cos(crank - rocker), k1 = d/a, k2 = d/c,
    k3 = (a^2 - b^2 + c^2 + d^2)/(2 a c)."""
    a, b, c, d = 0.04, 0.12, 0.09, 0.10
    block = running("four-bar")
    for y in motion(block, 1.0):
        crank, _, rocker = y["q"]
        left = d / a * math.cos(rocker) - d / c * math.cos(crank)
        left += (a**2 - b**2 + c**2 + d**2) / (2 * a * c)
        assert left == pytest.approx(math.cos(crank - rocker), abs=1e-12)
    assert crank == pytest.approx(math.pi / 3 + 2 * math.pi, abs=0.05)


def test_parallelogram_is_balanced_and_keeps_its_branch_through_the_singular_pose():
    """One pendulum of inertia 3 (I + m r^2) + M l^2 without weight: it turns at constant speed,
    though every rod lines up twice a turn and one closure of the four is redundant."""
    block = running("parallelogram", "linkage.start_velocity={left=4, middle=4, right=4, hinge=-4}")
    for k, y in enumerate(motion(block, 2.0)):
        assert y["q"][:3] == pytest.approx(0.5 + 4 * (k + 1) * H, abs=1e-10)
        assert y["q"][3] == pytest.approx(-y["q"][0], abs=1e-10)
    spinning = 0.5 * (3 * (1e-3 + 0.3 * 0.1**2) + 0.55 * 0.2**2) * 4**2
    weight = 9.81 * 0.2 * math.sin(y["q"][0])
    spring = 0.5 * 98.1 * (0.2**2 + 0.1**2 - 2 * 0.2 * 0.1 * math.sin(y["q"][0]))
    assert y["energy"] == pytest.approx(spinning + weight + spring, rel=1e-10)


def test_slider_crank_places_its_piston():
    block = running("slider-crank")
    for y in motion(block, 1.0):
        crank = y["q"][0]
        piston = 0.05 * math.cos(crank) + math.sqrt(0.15**2 - (0.05 * math.sin(crank)) ** 2)
        assert y["x"] == pytest.approx([piston, 0, 0], abs=1e-12)
    assert crank > 4 * math.pi


def test_trammel_draws_an_ellipse_with_massless_blocks():
    """A quarter of the rod from the block on x: (x/.75)^2 + (y/.25)^2 = 1, without loss."""
    block = running("trammel")
    begin = block.y["energy"]
    for y in motion(block, 3.0):
        assert math.hypot(y["x"][0] / 0.75, y["x"][1] / 0.25) == pytest.approx(1, abs=1e-12)
    assert y["energy"] == pytest.approx(begin, abs=1e-8)


def test_six_bar_draws_the_output_of_its_coupler_point():
    block = running("six-bar")
    for y in motion(block, 1.0):
        crank, wrist, _, _, output = y["q"]
        at = 0.04 * np.array([math.cos(crank), math.sin(crank)])
        turn = crank + wrist
        point = at + 0.06 * np.array([math.cos(turn), math.sin(turn)])
        point += 0.07 * np.array([-math.sin(turn), math.cos(turn)])
        end = np.array([0.17, 0.12]) + 0.15 * np.array([math.cos(output), math.sin(output)])
        assert np.linalg.norm(end - point) == pytest.approx(0.16, abs=1e-12)


def test_the_instrument_turns_about_the_trocar():
    """No joint is there, and one parallelogram would do: two redundant closures."""
    block = running("remote-centre").set(F_hand=(3.0, 0.5, 0.0))
    angles = []
    for y in motion(block, 0.3):
        x, theta = y["x"][:2], y["x"][2]
        trocar = np.array([0.0, 0.06]) - x
        assert trocar[0] * math.sin(theta) - trocar[1] * math.cos(theta) == pytest.approx(
            0, abs=1e-12
        )
        assert np.dot(trocar, (math.cos(theta), math.sin(theta))) == pytest.approx(
            -y["q"][5], abs=1e-12
        )
        angles.append(theta)
    assert np.ptp(angles) > 0.1


def test_a_family_has_the_members_asked_for_and_takes_changes():
    options = ["linkage.body.rocker3.mass=2.0", "linkage.n=3", "linkage.gravity=[0.0, -1.0]"]
    linkage = open_scene.load("n-four-bar", options).linkage
    assert [len(linkage.body), len(linkage.joint), len(linkage.loop)] == [7, 7, 3]
    assert [b.mass for b in linkage.body] == [1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0]
    assert linkage.gravity == (0.0, -1.0)
