"""Twin pantograph: kinematics, dynamics, sensing and actuation as properties over the workspace."""

from functools import cache
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hapticlink.components.device.device_model import FRICTION_RATE
from hapticlink.components.device.models import device_model
from hapticlink.components.device.pose_coordinates import PoseCoordinates
from tests.devices import device
from tests.reference import twin_pantograph

MODEL = device_model(device())
P, DEVICE = MODEL.numbers, SimpleNamespace(**twin_pantograph.NUMBERS)
ROUGH = {"motor_damping": 2e-3, "motor_friction": 6e-3}
POSE, V, WRENCH, ANGLES = (ca.SX.sym(s, n) for s, n in (("x", 3), ("v", 3), ("F", 3), ("a", 4)))


def function(arguments, expressions):
    """Of `expressions`, which are made when it is called first: not where tests are collected."""

    @cache
    def made():
        return ca.Function("f", list(arguments), [*expressions()])

    def call(*values):
        out = [np.array(v) for v in made().call([ca.DM(v) for v in values])]
        return out[0] if len(out) == 1 else out

    return call


DISTAL = [f"{arm}_distal" for arm in ("a_left", "a_right", "b_left", "b_right")]
angles = function([POSE], lambda: [MODEL.angles(POSE, P)])
distal = function(
    [POSE], lambda: [ca.vertcat(*(MODEL.frames(POSE, P)[body].angle for body in DISTAL))]
)
jacobian = function([POSE], lambda: [MODEL.jacobian(POSE, P)])
dynamics = function([POSE, V], lambda: MODEL.dynamics(POSE, V, P))
margins = function([POSE], lambda: [MODEL.margins(POSE, P)])
stop = function([POSE, V], lambda: [MODEL.stop_force(POSE, V, P)])
estimate = function([ANGLES, POSE], lambda: [MODEL.place_from_angles(ANGLES, POSE, P)])
estimate_4 = function(
    [ANGLES, POSE], lambda: [MODEL.place_from_angles(ANGLES, POSE, P, iterations=4)]
)
torques = function([WRENCH, POSE], lambda: [MODEL.motor_torques(WRENCH, POSE, P)])
friction = function([ANGLES], lambda: [MODEL.friction_torques(ANGLES, ca.SX(FRICTION_RATE), ROUGH)])


def reach(pose):
    return 0.95 * 0.36 - margins(pose)[:4]


workspace = st.tuples(st.floats(-0.06, 0.05), st.floats(-0.05, 0.05), st.floats(-20, 20))
wrenches = st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-0.2, 0.2))
twists = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-5, 5))


@given(workspace)
def test_links_close_on_the_crank_ends_with_elbows_outward(pose):
    q, psi = angles(pose).ravel(), distal(pose).ravel()
    half = DEVICE.crank / 2 * np.array([np.cos(pose[2]), np.sin(pose[2])])
    ends = np.array(pose[:2]) + np.array([-half, -half, half, half])
    left_right = np.array([-1, 1, -1, 1])
    base = np.column_stack(
        [DEVICE.base_x + DEVICE.base_half_width * left_right, [-0.2, -0.2, 0.2, 0.2]]
    )
    elbow = base + DEVICE.proximal_length * np.column_stack([np.cos(q), np.sin(q)])
    reached = elbow + DEVICE.distal_length * np.column_stack([np.cos(psi), np.sin(psi)])
    np.testing.assert_allclose(reached, ends, atol=1e-14)
    chord = ends - base
    turn = chord[:, 0] * (elbow - base)[:, 1] - chord[:, 1] * (elbow - base)[:, 0]
    toward = np.array([1, 1, -1, -1])
    assert (turn * -left_right * toward > 0).all()


@given(workspace)
def test_jacobian_is_the_derivative(pose):
    step = 1e-6
    numeric = [(angles(pose + step * e) - angles(pose - step * e)) / (2 * step) for e in np.eye(3)]
    np.testing.assert_allclose(jacobian(pose), np.hstack(numeric), atol=1e-7)


@given(workspace)
def test_angles_do_not_jump_as_the_handle_turns(pose):
    turned = (*pose[:2], pose[2] + 2 * np.pi)
    np.testing.assert_allclose(angles(turned), angles(pose), atol=1e-12)
    near = (*pose[:2], pose[2] + 1e-5)
    assert np.abs(angles(near) - angles(pose)).max() < 1e-5


@given(workspace, twists)
def test_mass_matrix_is_that_of_the_moving_parts(pose, v):
    """v' M v = 2 T, with T from velocities of the parts by finite differences."""
    step = 1e-6

    def parts(at):
        q, psi = angles(at).ravel(), distal(at).ravel()
        tip = np.column_stack([np.cos(q), np.sin(q)])
        along = np.column_stack([np.cos(psi), np.sin(psi)])
        center = DEVICE.proximal_length * tip + DEVICE.distal_center * along
        return q, psi, DEVICE.proximal_center * tip, center

    after, before = parts(pose + step * np.array(v)), parts(pose - step * np.array(v))
    q, psi, proximal, center = ((a - b) / (2 * step) for a, b in zip(after, before, strict=True))
    twice_T = (
        (DEVICE.rotor_inertia + DEVICE.proximal_inertia) * (q**2).sum()
        + DEVICE.proximal_mass * (proximal**2).sum()
        + DEVICE.distal_mass * (center**2).sum()
        + DEVICE.distal_inertia * (psi**2).sum()
        + DEVICE.handle_mass * (v[0] ** 2 + v[1] ** 2)
        + DEVICE.handle_inertia * v[2] ** 2
    )
    M, _ = dynamics(pose, v)
    assert np.array(v) @ M @ v == pytest.approx(twice_T, rel=1e-6, abs=1e-12)
    np.testing.assert_allclose(M, M.T, atol=1e-15)
    assert np.linalg.eigvalsh(M)[0] > 0


@given(workspace, twists)
def test_rate_of_the_mass_matrix_less_2C_is_skew(pose, v):
    step = 1e-6
    M_after, _ = dynamics(pose + step * np.array(v), v)
    M_before, _ = dynamics(pose - step * np.array(v), v)
    _, C = dynamics(pose, v)
    N = (M_after - M_before) / (2 * step) - 2 * C
    np.testing.assert_allclose(N, -N.T, atol=1e-6)


def test_the_default_device_fits_the_reported_motion():
    """Over x -.06 to .05, |y| <= .05 m and every theta: far from singular, light, well sensed."""
    rows = []
    for x in np.linspace(-0.06, 0.05, 5):
        for y in np.linspace(-0.05, 0.05, 5):
            for theta in np.linspace(0, 2 * np.pi, 24, endpoint=False):
                J = jacobian((x, y, theta))
                M, _ = dynamics((x, y, theta), (0, 0, 0))
                mobility = np.linalg.inv(M)
                apparent = 1 / np.linalg.eigvalsh(mobility[:2, :2])
                count = DEVICE.encoder_resolution * np.linalg.pinv(J)
                rows.append(
                    (
                        reach((x, y, theta)).max() / 0.36,
                        np.linalg.cond(J @ np.diag([1, 1, 1 / 0.04])),
                        apparent.min(),
                        apparent.max(),
                        1 / mobility[2, 2],
                        np.linalg.norm(count[:2], 2),
                        np.linalg.norm(count[2]),
                        margins((x, y, theta)).min(),
                    )
                )
    stretch, condition, light, heavy, inertia, position, angle, margin = np.array(rows).T
    assert stretch.max() < 0.845
    assert condition.max() < 2.65
    assert light.min() > 0.22
    assert heavy.max() < 0.37
    assert inertia.min() > 2.5e-4
    assert inertia.max() < 4.8e-4
    assert position.max() < 0.215e-3
    assert angle.max() < 5.2e-3
    assert margin.min() > 0.03


@given(workspace, wrenches)
@example((0.01, -0.02, 0.7), (9.0, -5.0, 0.1))
@example((0.01, -0.02, 0.7), (0.9, -0.5, 0.01))
def test_torques_give_the_wrench_with_least_norm_or_saturate_in_its_direction(pose, wrench):
    tau = torques(wrench, pose).ravel()
    J = jacobian(pose)
    asked = np.linalg.pinv(J.T) @ wrench
    if np.abs(asked).max() <= DEVICE.torque_limit:
        np.testing.assert_allclose(J.T @ tau, wrench, atol=1e-12)
    np.testing.assert_allclose(
        tau, asked * min(1, DEVICE.torque_limit / max(np.abs(asked).max(), 1e-9)), atol=1e-12
    )


@given(workspace, st.tuples(*[st.floats(-3.5e-3, 3.5e-3)] * 2, st.floats(-0.1, 0.1)))
def test_pose_from_exact_angles(pose, off):
    """Two iterations from 5 mm and 0.1 rad away come within 1 % of a count, at any turn."""
    guess = np.array(pose) + off
    error = estimate(angles(pose), guess).ravel() - pose
    assert np.abs(angles(pose + error) - angles(pose)).max() < 0.01 * DEVICE.encoder_resolution
    assert abs(error[2]) < 1e-3


@given(workspace, st.tuples(*[st.floats(-0.5, 0.5)] * 4))
def test_pose_is_the_least_squares_one(pose, counts):
    """Angles that no pose has: the residual is normal to the columns of J_q."""
    measured = angles(pose) + DEVICE.encoder_resolution * np.array(counts)[:, None]
    found = estimate_4(measured, pose).ravel()
    J, r = jacobian(found), measured - angles(found)
    np.testing.assert_allclose(J.T @ r, 0, atol=1e-7)


def test_margin_is_the_distance_to_the_nearest_limit():
    """theta = 0: the reach of each arm is Pythagoras."""
    y = 0.06
    ends = np.array([-0.04, -0.04, 0.04, 0.04])
    bases = DEVICE.base_x + 0.03 * np.array([-1, 1, -1, 1])
    r = np.hypot(ends - bases, y - np.array([-0.2, -0.2, 0.2, 0.2]))
    found = margins((0, y, 0)).ravel()
    np.testing.assert_allclose(found[:4], 0.95 * 0.36 - r, atol=1e-15)
    np.testing.assert_allclose(found[4:], r - (0.04 + 0.05 * 0.36), atol=1e-15)


def test_stops_push_back_and_only_beyond_the_margin():
    inside = (0.0, 0.09, 0.0)
    assert margins(inside).min() > 0
    np.testing.assert_array_equal(stop(inside, (0, 1.0, 0)), 0)
    outside = (0.0, 0.145, 0.0)
    assert margins(outside).min() < 0
    assert stop(outside, (0, 0, 0))[1] < 0
    assert stop(outside, (0, 0.3, 0))[1] < stop(outside, (0, 0, 0))[1]
    np.testing.assert_array_equal(stop(outside, (0, -50.0, 0)), 0)  # never pulls


def test_velocity_term_is_the_christoffel_matrix_times_the_velocity():
    term = function([POSE, V], lambda: MODEL.motion(POSE, V, P))
    for pose, v in (
        ((0.01, -0.02, 0.4), (0.3, -0.2, 4.0)),
        ((-0.04, 0.03, 3.5), (-0.1, 0.5, -6.0)),
    ):
        M, C = dynamics(pose, v)
        M_again, c = term(pose, v)
        np.testing.assert_allclose(M_again, M, rtol=1e-14)
        np.testing.assert_allclose(np.ravel(c), C @ v, rtol=1e-12, atol=1e-16)


@settings(max_examples=20)
@given(st.tuples(*[st.floats(-20, 20)] * 4))
def test_motors_rub_against_their_rates(rates):
    """b q' + f where a motor turns much faster than friction changes sign; no power is given."""
    w = np.array(rates)
    found = friction(w).ravel()
    assert (found * w <= 0.0).all()
    fast = np.abs(w) > 10 * FRICTION_RATE
    expected = -2e-3 * w - 6e-3 * np.sign(w)
    np.testing.assert_allclose(found[fast], expected[fast], rtol=1e-6)


@given(workspace, twists, wrenches)
def test_the_twin_of_a_file_is_the_twin_in_closed_form(pose, v, wrench):
    """Relative to the largest entry of each: M_d, C_d and c, J_q, angles, margins, stops,
    torques."""
    for found, expected in zip(FROM_FILE(pose, v, wrench), CLOSED(pose, v, wrench), strict=True):
        scale = max(np.abs(expected).max(), 1e-9)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * scale)


def _all(model, p, stop, angles):
    return function(
        [POSE, V, WRENCH],
        lambda: (
            *model.dynamics(POSE, V, p), model.motion(POSE, V, p)[1], model.jacobian(POSE, p),
            angles(POSE, p), model.margins(POSE, p), stop(POSE, V, p),
            model.motor_torques(WRENCH, POSE, p),
        ),
    )  # fmt: skip


FROM_FILE = _all(MODEL, P, MODEL.stop_force, MODEL.angles)
CLOSED = _all(
    twin_pantograph,
    twin_pantograph.NUMBERS,
    twin_pantograph.stop_wrench,
    twin_pantograph.base_angles,
)


def test_the_twin_needs_no_joint_coordinates():
    assert isinstance(MODEL, PoseCoordinates)


@pytest.mark.parametrize("pose", [(5.0, 0.0, 0.0), (-0.035, -0.2, 1.0), (0.3, 0.25, 2.0)])
def test_beyond_reach_all_is_finite_and_the_stops_lead_back(pose):
    """Farther than an arm, on a base joint, and outside the workspace."""
    v = (0.5, -0.5, 3.0)
    for value in (*dynamics(pose, v), jacobian(pose), angles(pose), stop(pose, v)):
        assert np.isfinite(value).all()
    assert margins(pose).min() < 0
    assert np.linalg.eigvalsh(dynamics(pose, v)[0]).min() > 0
    if pose[0] > 1:
        assert stop(pose, (0.0, 0.0, 0.0))[0] < 0
