"""Applied forces against closed forms and energy balances."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ellipk

from hapticlink.components.specs.drives import ConstantDrive, PDDrive, ProfileDrive
from hapticlink.components.specs.linkage import Body, Spring
from studies.report import appendix_a
from tests.blocks import advance, running
from tests.mechanisms import five_bar, one_body, rod


def pendulum(**fields):
    """A uniform rod of 1 m and 1 kg; the angle from the x axis."""
    return running(one_body(rod("rod", 1.0), at=(1.0, 0.0), **fields))


def slider(**fields):
    """A block of 2 kg at 0.1 m on a rail along x."""
    block = Body(name="block", mass=2.0, inertia=1.0)
    return running(one_body(block, start=0.1, type="prismatic", **fields))


def test_pendulum_swings_with_its_elliptic_period():
    """From rest at amplitude A, T = 4 sqrt(I/(m g l)) K(sin^2(A/2))."""
    g, amplitude = 9.81, 1.2
    period = 4 * np.sqrt((1 / 3) / (0.5 * g)) * ellipk(np.sin(amplitude / 2) ** 2)
    block = pendulum(gravity=(0.0, -g), start=-np.pi / 2 + amplitude)
    energy = block.y["energy"]
    advance(block, period / 2, 2000 / period)
    assert block.y["q"][0] == pytest.approx(-np.pi / 2 - amplitude, abs=1e-9)
    assert block.y["energy"] == pytest.approx(energy, abs=1e-9)


def test_joint_spring_and_damper_are_a_damped_oscillator():
    k, b, rest, m = 8.0, 0.8, 0.3, 2.0
    block = advance(slider(stiffness=k, damping=b, rest=rest), 2.0, 1000)
    decay, omega = b / (2 * m), np.sqrt(k / m - (b / (2 * m)) ** 2)
    envelope = np.exp(-decay * 2.0) * (0.1 - rest)
    exact = rest + envelope * (np.cos(omega * 2) + decay / omega * np.sin(omega * 2))
    assert block.y["q"][0] == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("length", [None, 0.2])
def test_spring_between_two_bodies_pulls_along_its_line(length):
    """Joint efforts by virtual work from the hand-computed force."""
    spring = Spring(
        bodies=("link1", "link3"), at=((0.03, 0.01), (0.01, -0.02)), stiffness=50.0, length=length
    )
    plain, sprung = (running(replace(five_bar(), spring=s)) for s in ((), (spring,)))
    q = plain.state["q"]

    def ends(q):
        r = [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in (q[0], q[2])]
        return r[0] @ (0.03, 0.01) - r[1] @ (0.01, -0.02)

    span = ends(q)
    tension = 50.0 * (np.linalg.norm(span) - (length or 0.0)) * span / np.linalg.norm(span)
    J = np.array([(ends(q + e) - ends(q - e)) / 2e-6 for e in 1e-6 * np.eye(4)])
    qdd, _ = appendix_a.solution(q, np.zeros(4), -J @ tension)
    np.testing.assert_allclose(sprung.y["qdd"], qdd, rtol=1e-7)
    stored = 0.5 * 50.0 * (np.linalg.norm(span) - (length or 0.0)) ** 2
    assert sprung.y["energy"] - plain.y["energy"] == pytest.approx(stored, rel=1e-12)


def test_damper_between_points_takes_what_the_linkage_loses():
    spring = Spring(bodies=("ground", "rod"), at=((1.0, 1.0), (1.0, 0.0)), damping=0.7)
    block = pendulum(spring=(spring,), rate=2.0)
    # I qdd = -b l^2 qd for a damper without a free length (all relative motion of the points)
    advance(block, 1.0, 1000)
    assert block.y["qd"][0] == pytest.approx(2.0 * np.exp(-0.7 / (1 / 3)), rel=1e-10)


def test_a_damper_with_a_free_length_damps_along_its_line():
    """At 0.6 of the rail's direction: the force -b (v . u) u, u the line's direction."""
    spring = Spring(
        bodies=("ground", "block"), at=((3.1, 4.0), (0.0, 0.0)), damping=3.0, length=1.0
    )
    qdd = slider(spring=(spring,), rate=2.0).y["qdd"][0]
    assert qdd == pytest.approx(-3.0 * (2.0 * 0.6) * 0.6 / 2.0, rel=1e-12)


def test_a_spring_whose_points_meet_pushes_nowhere():
    """k l and no direction for it; a nudge later it pushes with all of it."""
    spring = Spring(
        bodies=("ground", "block"),
        at=((0.1, 0.0), (0.0, 0.0)),
        stiffness=50.0,
        damping=3.0,
        length=0.2,
    )
    block = slider(spring=(spring,))
    assert block.y["qdd"][0] == 0
    assert block.y["energy"] == pytest.approx(0.5 * 50.0 * 0.2**2, rel=1e-15)
    advance(block, 0.1, 1000)
    assert block.y["q"][0] == 0.1
    block.put(q=0.1 + 1e-9)
    assert block.y["qdd"][0] == pytest.approx(50.0 * 0.2 / 2.0, rel=1e-6)


def test_drives():
    constant = advance(slider(drive=ConstantDrive(effort=3.0)), 1.0, 1000)
    assert constant.y["q"][0] == pytest.approx(0.1 + 0.5 * 1.5, abs=1e-12)

    table = ((0.0, 0.0), (1.0, 2.0))
    profile = advance(slider(drive=ProfileDrive(table=table)), 1.0, 1000)
    assert profile.y["q"][0] == pytest.approx(0.1 + 1 / 6, abs=1e-12)  # m q'' = 2 t

    servo = PDDrive(table=((0.0, 0.1), (0.5, 0.4)), stiffness=200.0, damping=30.0)
    block = advance(slider(drive=servo), 2.4, 1000)
    assert block.y["q"][0] == pytest.approx(0.4, abs=1e-6)  # the table's end is held


def test_bias_acceleration_carries_gravity():
    """At rest with no wrench, a_bias is the operational acceleration itself."""
    block = pendulum(gravity=(0.0, -9.81))
    np.testing.assert_allclose(block.y["a_bias"], [0, -1.5 * 9.81, -1.5 * 9.81], rtol=1e-12)
