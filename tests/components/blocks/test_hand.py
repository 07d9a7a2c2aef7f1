"""The hand: wrench, table, arm."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hapticlink.components.blocks.hand import hand
from hapticlink.components.specs.hand import (
    ArmHand,
    ConstantHand,
    FingertipHand,
    ProfileHand,
    SpringHand,
)
from tests.blocks import Running, advance

TABLE = ((0.5, 0.0, 1.0, 0.0), (1.0, 2.0, 1.0, 0.01), (1.5, 0.0, -1.0, 0.01))


def test_constant_wrench_needs_no_input():
    component = hand(ConstantHand(wrench=(-0.5, 0, -0.0025)))
    assert component.inputs == ()
    np.testing.assert_array_equal(Running(component).y["F"], (-0.5, 0, -0.0025))


def test_damping_to_ground():
    component = hand(ConstantHand(wrench=(1, 2, 3), damping=(1, 2, 0.5)))
    assert [v.name for v in component.inputs] == ["v"]
    y = Running(component, {"v": (0.1, 0.2, 4)}).y
    np.testing.assert_allclose(y["F"], (0.9, 1.6, 1.0), rtol=1e-15)


def test_profile_is_the_table():
    """Against NumPy's interpolation, which holds the ends too."""
    running = Running(hand(ProfileHand(table=TABLE)))
    rows = np.array(TABLE)
    for running.t in np.linspace(0, 2, 41):
        expected = [np.interp(running.t, rows[:, 0], column) for column in rows.T[1:]]
        np.testing.assert_allclose(running.y["F"], expected, atol=1e-14)


def test_arm_starts_at_the_handle_with_no_force():
    x, v = (0.01, -0.02, 3.6), (0.3, -0.1, 2.0)
    running = Running(hand(ArmHand(target=((0.0, 0.1, 0, 0),))), {"x": x, "v": v})
    np.testing.assert_array_equal(running.y["F"], 0)
    np.testing.assert_array_equal(running.state["x_arm"], x)
    np.testing.assert_array_equal(running.state["v_arm"], v)


def test_arm_output_belongs_to_the_start_of_the_step():
    """F_k is from x_k and v_k: a handle that jumps is felt at once."""
    running = Running(hand(ArmHand(target=((0.0, 0, 0, 0),))))
    running.set(x=(0.001, 0, 0.01), v=(0.1, 0, 0))
    np.testing.assert_allclose(running.y["F"], (-2000 * 0.001 - 20 * 0.1, 0, -5 * 0.01), rtol=1e-14)


def test_arm_follows_its_target_path():
    """A clamped handle and a moving target, against SciPy."""
    spec = ArmHand(target=((0.0, 0, 0, 0), (0.5, 0.05, -0.02, 0.8)))
    m, k, b = (np.array(v) for v in (spec.mass, spec.stiffness, spec.damping))
    kg, bg = np.array(spec.grip_stiffness), np.array(spec.grip_damping)
    rate = np.array([0.1, -0.04, 1.6])

    def derivative(t, x):
        pull = k * (rate * t - x[:3]) + b * (rate - x[3:])
        return np.concatenate([x[3:], (pull - kg * x[:3] - bg * x[3:]) / m])

    exact = solve_ivp(derivative, (0, 0.4), np.zeros(6), "DOP853", rtol=1e-11, atol=1e-14).y[:, -1]
    running = advance(Running(hand(spec)), 0.4)
    np.testing.assert_allclose(running.x[:6], exact, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(running.y["F"], kg * exact[:3] + bg * exact[3:], rtol=1e-5)


def test_arm_settles_between_target_and_handle():
    """At rest the two springs share the distance."""
    running = advance(Running(hand(ArmHand(target=((0.0, 0.1, 0, 0),)))), 8.0)
    assert running.y["F"][0] == pytest.approx(0.1 * 300 * 2000 / 2300, rel=1e-9)


def test_a_spring_pulls_to_its_moving_target():
    gains = {"stiffness": (100.0, 200.0, 3.0), "damping": (1.0, 2.0, 0.1)}
    target = ((0.0, 0.0, 0.0, 0.0), (1.0, 0.1, 0.2, 0.3))
    x, v = np.array([0.01, -0.02, 0.3]), np.array([0.5, 0.0, -1.0])
    block = Running(hand(SpringHand(**gains, target=target))).set(x=x, v=v)
    block.t = 0.5
    rate = np.array([0.1, 0.2, 0.3])
    expected = [100, 200, 3] * (0.5 * rate - x) + [1, 2, 0.1] * (rate - v)
    np.testing.assert_allclose(block.y["F"], expected, rtol=1e-13)


@pytest.mark.parametrize("kind", [SpringHand, ArmHand])
def test_a_target_is_a_direction_which_begins_within_half_a_turn_of_the_handle(kind):
    """Whole turns change nothing, and go on with the target's path."""
    stiff = {"stiffness": (300.0, 300.0, 1.0)} if kind is SpringHand else {}
    x, forces = (0.01, 0.02, 7.5), []
    for turns in (0, 1, -2):
        first = 7.3 + 2 * np.pi * turns
        spec = kind(**stiff, target=((0.0, 0.0, 0.0, first), (0.5, 0.0, 0.0, first + 9.0)))
        running = advance(Running(hand(spec), {"x": x}), 0.2)
        forces.append(running.y["F"])
    np.testing.assert_allclose(forces[1:], [forces[0]] * 2, rtol=1e-9)
    assert abs(forces[0][2]) > 0.1


def test_a_fingertip_is_an_arm_of_two_lengths_that_gives_no_moment():
    spec = FingertipHand(target=((0.0, 0.0, 0.0, 0.0), (0.5, 0.05, -0.02, 3.0)))
    finger = hand(spec)
    lengths = (
        (spec.mass, spec.mass, 1.0),
        *(
            (v, v, 0.0)
            for v in (spec.stiffness, spec.damping, spec.pulp_stiffness, spec.pulp_damping)
        ),
    )
    names = ("mass", "stiffness", "damping", "grip_stiffness", "grip_damping")
    arm = hand(ArmHand(**dict(zip(names, lengths, strict=True)), target=spec.target))
    found, whole = (advance(Running(block, {"x": (0.001, 0, 2.0)}), 0.3) for block in (finger, arm))
    np.testing.assert_allclose(found.y["F"], whole.y["F"], rtol=1e-12, atol=1e-15)
    assert found.y["F"][2] == 0.0
    assert np.abs(found.y["F"]).max() > 0.01
    assert [v.size for v in finger.states] == [2, 2]
