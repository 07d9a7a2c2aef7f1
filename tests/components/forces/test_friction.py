"""Coulomb friction of joints: it sticks, slides by its own rate, and dissipates."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hapticlink.components.specs.drives import PDDrive
from hapticlink.components.specs.linkage import Body, Joint, Loop
from hapticlink.orchestrator import open_scene
from tests import blocks
from tests.blocks import RATES, advance, order
from tests.mechanisms import five_bar, one_body

MASS, G, SLOPE = 2.0, 9.81, 0.4
WEIGHT = MASS * G * math.sin(SLOPE)  # along the slope
ALONG = np.array([math.cos(SLOPE), -math.sin(SLOPE), 0.0])


def block(speed=0.0, start=0.0, gravity=(0.0, -G), **joint):
    """A block on a slope."""
    body = Body(name="block", mass=MASS, inertia=0.1)
    return one_body(
        body, start=start, rate=speed, gravity=gravity, type="prismatic", axis=-SLOPE, **joint
    )


def running(linkage, step_s=2e-3, **mechanism):
    return blocks.running(linkage, step_s=step_s, **mechanism)


@pytest.mark.parametrize("integrator", ["semi-implicit-euler", "rk4", "linearly-implicit"])
def test_a_block_below_the_friction_angle_stays_for_a_minute(integrator):
    resting = running(block(friction=1.05 * WEIGHT), integrator=integrator)
    far = 0.0
    for _ in range(60):
        advance(resting, 1.0)
        far = max(far, abs(resting.state["q"][0]))
    assert far < 1e-9
    assert abs(resting.y["qdd"][0]) < 1e-9


def test_a_push_below_the_friction_leaves_no_trace():
    """Pushed back and forth for a minute, by up to what friction holds beyond the weight."""
    pushed = running(block(friction=1.5 * WEIGHT))
    rng = np.random.default_rng(0)
    for _ in range(600):
        pushed.set(F_hand=rng.uniform(-0.3, 0.2) * WEIGHT * ALONG)
        advance(pushed, 0.1)
    pushed.set(F_hand=np.zeros(3))
    advance(pushed, 2.0)
    assert abs(pushed.state["q"][0]) < 1e-9


def test_a_block_above_the_friction_angle_slides_by_what_is_left():
    sliding = advance(running(block(friction=0.6 * WEIGHT)), 1.0)
    a = 0.4 * WEIGHT / MASS
    assert sliding.state["qd"][0] == pytest.approx(a, abs=2e-3)  # from the deflection to sliding
    before = sliding.state["qd"][0]
    assert advance(sliding, 1.0).state["qd"][0] - before == pytest.approx(a, rel=1e-12)


def test_a_spring_with_friction_rests_where_coulomb_says():
    """x_n = (-1)^n (x_0 - 2 n f/k) at the n-th turn; it stays where k |x_n| < f."""
    k, f, start = 200.0, 3.0, 0.1
    rubs = {"friction": f, "friction_deflection": 1e-5, "friction_speed": 5e-3}
    sprung = running(block(start=start, gravity=None, stiffness=k, **rubs), 5e-4)
    turns = math.ceil((k * start / f - 1) / 2)
    rest = (-1) ** turns * (start - 2 * turns * f / k)
    assert advance(sprung, 5.0, 2000).state["q"][0] == pytest.approx(rest, abs=3e-5)
    assert advance(sprung, 60.0).state["q"][0] == pytest.approx(rest, abs=3e-5)


def test_stick_slip_against_scipy():
    """A servo pulls a block over sticking and sliding; order 2 at least, where it changes over."""
    f, d, v_f, k, b = 5.0, 2e-4, 0.02, 300.0, 2.0

    def rhs(t, y):
        e = min(max(y[2] + d / v_f * y[1], -d), d)
        pull = k * (0.02 * math.sin(3 * t) - y[0]) - b * y[1]
        return [y[1], (pull - f * e / d) / MASS, (e - y[2]) * v_f / d]

    exact = solve_ivp(rhs, (0, 4), np.zeros(3), "DOP853", rtol=1e-12, atol=1e-15, max_step=1e-3)
    rubs = {"friction": f, "friction_deflection": d, "friction_speed": v_f}
    errors = []
    for rate in RATES:
        pulled = running(block(gravity=None, stiffness=k, damping=b, **rubs))
        for i in range(4 * rate):
            # the mean of the pull over a step, to O(h^4) of the motion's error O(h^2)
            a, c = 3 * i / rate, 3 * (i + 1) / rate
            mean = (math.cos(a) - math.cos(c)) / (c - a)
            pulled.set(F_hand=k * 0.02 * mean * ALONG)
            pulled.step(1 / rate)
        errors.append(abs(pulled.state["q"][0] - exact.y[0, -1]))
    assert order(errors) > 1.7
    assert errors[1] < 1e-6


def test_friction_in_longer_steps_than_its_own_stays_bounded():
    """Steps of .1 s where it was built for 2 ms: as large as the friction, no larger."""
    thrown = running(block(speed=1.0, friction=0.5, gravity=None))
    for _ in range(200):
        thrown.step(0.1)
        assert abs(thrown.y["qdd"][0]) <= 0.25 + 1e-12
    assert abs(thrown.state["q"][0]) < 4.0


@pytest.mark.parametrize(
    ("step_s", "speed"),
    [(1e-4, 2.0), (1e-3, 2.0), (1e-2, 2.0), (0.1, 2.0), (2e-3, 0.5), (2e-3, 50.0)],
)
def test_a_block_that_is_thrown_stops_where_its_energy_is_spent(step_s, speed):
    """f x = m v^2/2, at any rate and speed, to the deflection 16 f h^2/m; and it stays."""
    f = 4.0
    thrown = running(block(speed=speed, friction=f, gravity=None), step_s)
    advance(thrown, MASS * speed / f + max(1.0, 300 * step_s), 1 / step_s)
    rest, deflection = thrown.state["q"][0], 16 * f / MASS * step_s**2
    assert rest == pytest.approx(MASS * speed**2 / (2 * f), abs=1.1 * deflection)
    assert abs(thrown.state["qd"][0]) < 1e-9
    assert advance(thrown, 100 * step_s, 1 / step_s).state["q"][0] == pytest.approx(rest, abs=1e-9)


def test_a_start_at_a_dead_centre_says_nothing_about_the_joint():
    """The piston of `slider-crank` does not move there: friction in it stops the crank all the
    same, and takes f times its way."""
    linkage = open_scene.load("slider-crank").linkage
    piston = next(j for j in linkage.joint if j.name == "cylinder")
    rubbing = replace(piston, friction=5.0, damping=None)
    joints = [
        rubbing if j is piston else replace(j, drive=None, damping=None) for j in linkage.joint
    ]
    start = {"crank": 0.0, "big_end": 0.0, "cylinder": 0.2}
    thrown = running(
        replace(linkage, joint=tuple(joints), start=start, start_velocity={"crank": 60.0})
    )
    index = [j.name for j in joints].index("cylinder")
    energy, way, before = thrown.y["energy"], 0.0, thrown.state["q"][index]
    for _ in range(250):
        thrown.step(5e-4)
        way, before = way + abs(thrown.state["q"][index] - before), thrown.state["q"][index]
    assert thrown.y["energy"] == pytest.approx(energy - 5.0 * way, rel=1e-3)
    advance(thrown, 5.0)
    assert np.abs(thrown.state["qd"]).max() < 1e-9


@pytest.mark.parametrize(
    ("key", "value"), [("friction_speed", 1e-3), ("friction_deflection", 1e-7)]
)
def test_what_a_step_cannot_integrate_is_refused(key, value):
    """f/(v_f m) = 5000 1/s and sqrt(f/(d m)) = 7071 1/s in steps of 2 ms; not if implicit."""
    linkage = block(friction=10.0, **{key: value})
    with pytest.raises(ValueError, match=f"`{key}` = .*too fast for steps of 0.002 s"):
        running(linkage)
    held = running(linkage, integrator="linearly-implicit")
    assert abs(advance(held, 1.0).state["q"][0]) < 1e-9


@given(st.floats(0, 50), st.floats(1e-4, 1e-2), st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_friction_dissipates(friction, deflection, seed):
    """E never grows by more than the hand puts in."""
    law = {"friction_deflection": deflection, "friction_speed": 200 * deflection}
    rubbed, rng = running(block(friction=friction, **law), 5e-4), np.random.default_rng(seed)
    spare = rubbed.y["energy"]
    for _ in range(30):
        push = rng.uniform(-40, 40)
        rubbed.set(F_hand=push * ALONG)
        for _ in range(10):
            q = rubbed.state["q"][0]
            rubbed.step(5e-4)
            spare += push * (rubbed.state["q"][0] - q)
            assert rubbed.y["energy"] <= spare + 1e-6 * (1 + abs(spare))


def test_a_linkage_with_a_redundant_loop_sticks_in_all_its_joints():
    """`parallelogram` without its spring: friction in its joints holds its weight from the start,
    and its closure is redundant."""
    linkage = open_scene.load("parallelogram").linkage
    joints = tuple(replace(j, friction=2.0) for j in linkage.joint)
    held = running(replace(linkage, joint=joints, spring=(), gravity=(0.0, -G)))
    start, deflection = held.state["q"], held.state["deflection"]
    assert np.abs(deflection).min() > 0
    assert np.abs(advance(held, 60.0).state["q"] - start).max() < 1e-9
    np.testing.assert_allclose(held.state["deflection"], deflection, atol=1e-9)


def test_a_cut_joint_rubs_as_one_of_the_tree():
    """`four-bar` with friction, a spring, a damper and a servo in the pivot between coupler and
    rocker, with this pivot cut, and with the rocker's cut instead."""
    rubs = {"friction": 0.01, "friction_speed": 0.5, "friction_deflection": 2e-3}
    rubs |= {"damping": 2e-3, "stiffness": 0.3, "rest": 1.5}
    table = ((0.0, 0.8), (0.4, 1.2), (1.0, 0.6))
    rubs["drive"] = PDDrive(table=table, stiffness=0.2, damping=1e-3)
    linkage = open_scene.load("four-bar").linkage
    joints = (replace(linkage.joint[0], drive=None), *linkage.joint[1:])
    linkage = replace(linkage, gravity=(0.0, -G), start_velocity={"crank": 8.0})
    pin = Loop(bodies=("rocker", "coupler"), at=((0.09, 0.0), (0.12, 0.0)), **rubs)
    cut = replace(linkage, joint=joints, loop=(pin,))
    q = running(cut).state["q"]
    elbow = Joint(
        name="elbow", parent="coupler", child="rocker", at_parent=(0.12, 0.0),
        at_child=(0.09, 0.0), **rubs,
    )  # fmt: skip
    whole = replace(
        linkage,
        joint=(*joints[:2], elbow),
        loop=(Loop(bodies=("rocker", "ground"), at=((0.0, 0.0), (0.1, 0.0))),),
        start={"crank": q[0], "wrist": q[1], "elbow": q[2] - q[0] - q[1]},
    )
    runs = [running(cut, 5e-4), running(whole, 5e-4)]
    runs[0].put(q=q)
    for _ in range(20):
        first, second = (advance(r, 0.05, 2000).y for r in runs)
        np.testing.assert_allclose(first["x"], second["x"], atol=1e-6)
        assert first["energy"] == pytest.approx(second["energy"], abs=1e-6)
    assert runs[0].state["deflection"] == pytest.approx(runs[1].state["deflection"], abs=1e-6)


def test_a_linkage_with_a_loop_slides_and_sticks():
    """The five-bar under a wrench, and once it is gone."""
    linkage = five_bar()
    linkage = replace(linkage, joint=tuple(replace(j, friction=5e-3) for j in linkage.joint))
    five = running(linkage).set(F_hand=(-0.5, 0.3, 0.0))
    advance(five, 0.2, 2000)
    assert np.abs(five.state["qd"]).max() > 0.5
    five.set(F_hand=(0.0, 0.0, 0.0))
    advance(five, 2.0, 2000)
    assert np.abs(five.state["qd"]).max() < 1e-3
