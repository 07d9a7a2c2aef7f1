"""Devices in space against the closed forms that are printed for them."""

import math

import casadi as ca
import numpy as np
import pytest

import hapticlink as hl
from hapticlink.components.device.models import device_model
from hapticlink.components.device.workspace import extents_along, margin
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene import read_and_check
from tests.devices import device
from tests.spatial_linkages import BAR_IN_HAND

ARM, SHIN, C, D, E, F, R, S = 0.060, 0.1025, 0.01443, 0.01125, 0.01125, -0.025, 0.0400, -0.02309
"""Of the Novint Falcon by libnifalcon, in the names of Stamper's thesis."""


def arm_angle(place, phi):
    """theta_1 of the arm at phi for a place of the platform (Stamper 1997, section 3.2), with its
    knee outward."""
    u = np.array([math.cos(phi), math.sin(phi), 0.0])
    v = np.array([-math.sin(phi), math.cos(phi), 0.0])
    to = place + C * u + F * v - R * u - S * v
    theta_3 = math.acos(to @ v / SHIN)
    length = D + E + SHIN * math.sin(theta_3)
    along, up = to @ u, to[2]
    reach = math.hypot(along, up)
    inner = math.acos((ARM**2 + reach**2 - length**2) / (2 * ARM * reach))
    return math.atan2(up, along) - inner


def test_angles_of_a_delta_are_those_of_its_inverse_kinematics():
    spec = device("falcon", base=[0.0, 0.0, 0.0])
    model, pose = device_model(spec), ca.SX.sym("pose", 3)
    z = model.place_at_pose(pose)
    angles = ca.Function("angles", [pose], [model.angles(z, model.numbers)], {"cse": True})
    draw = np.random.default_rng(1)
    for _ in range(20):
        place = np.array([*draw.uniform(-0.035, 0.035, 2), draw.uniform(0.09, 0.15)])
        wanted = [arm_angle(place, math.radians(at)) for at in (15, 135, 255)]
        np.testing.assert_allclose(np.array(angles(place)).ravel(), wanted, atol=1e-7)


L1, L2, L3 = 0.215, 0.170, 0.0325
M_A, I_A = 0.0202, (0.4864e-4, 0.001843e-4, 0.4864e-4)
M_C, I_C = 0.0249, (0.959e-4, 0.959e-4, 0.0051e-4)
SERIAL_RANGES = [(-1.5708, 1.5708), (-1.07, 1.2), (-0.4, 1.2), (-1.13, 0.96)]
I_BE, I_DF, I_BASE = (11.09e-4, 10.06e-4, 0.591e-4), (7.11e-4, 0.629e-4, 6.246e-4), 11.87e-4


def printed_inertia(q):
    """Of the Phantom Premium by its joints (Cavusoglu, Feygin, Tendick 2002)."""
    _, t2, t3 = q
    squares = L1**2 * (4 * M_A + M_C), L2**2 * M_A + 4 * L3**2 * M_C
    mean = 8 * I_BASE + sum(4 * (of[1] + of[2]) for of in (I_A, I_BE, I_C, I_DF)) + sum(squares)
    upper = 4 * (I_BE[1] - I_BE[2] + I_C[1] - I_C[2]) + squares[0]
    lower = 4 * (I_A[1] - I_A[2] + I_DF[1] - I_DF[2]) - squares[1]
    both = L1 * (L2 * M_A + L3 * M_C)
    first = (mean + upper * math.cos(2 * t2) + lower * math.cos(2 * t3)) / 8
    first += both * math.cos(t2) * math.sin(t3)
    across = -both * math.sin(t2 - t3) / 2
    second = I_BE[0] + I_C[0] + squares[0] / 4
    third = I_A[0] + I_DF[0] + squares[1] / 4
    return np.array([[first, 0, 0], [0, second, across], [0, across, third]])


def place_of_handle(q):
    reach = L1 * np.cos(q[1]) + L2 * np.sin(q[2])
    up = L2 - L2 * np.cos(q[2]) + L1 * np.sin(q[1])
    return np.array([np.sin(q[0]) * reach, up, np.cos(q[0]) * reach - L1])


@pytest.mark.parametrize(
    "q", [(0.0, 0.0, 0.0), (0.6, 0.5, 0.9), (-0.8, -0.4, 0.2), (0.2, 0.9, 0.3)]
)
def test_kinematics_and_inertia_of_a_serial_arm_are_those_that_are_printed(q):
    """M = J^-T M_q J^-1, with the Jacobian by differences of the printed kinematics."""
    model, pose = device_model(device("phantom-premium")), ca.SX.sym("pose", 3)
    z, p = model.place_at_pose(pose), model.numbers
    found = [model.angles(z, p), model.motion(z, ca.SX(3, 1), p)[0]]
    angles, M = ca.Function("at", [pose], found, {"cse": True})(place_of_handle(q))
    np.testing.assert_allclose(np.array(angles).ravel(), q, atol=1e-8)
    h = 1e-6 * np.eye(3)
    J = np.array([(place_of_handle(q + s) - place_of_handle(q - s)) / 2e-6 for s in h]).T
    back = np.linalg.inv(J)
    wanted = back.T @ printed_inertia(q) @ back
    np.testing.assert_allclose(np.array(M), wanted, rtol=0, atol=1e-7 * np.abs(wanted).max())


def test_the_workspace_of_a_delta_is_told_about_its_start_alone():
    """Along its axis the angles of its three arms are the same: their ranges are its ends, and not
    those where the arms are assembled on the other side of the base; to a part of a cell of the
    finer grid, .2 mm: next to straight, where the angle changes most, a fiftieth of a radian."""
    spec = device("falcon")
    *_, (low, high) = extents_along(spec)
    for at, angle in ((low, -0.5), (high, 1.2)):
        assert arm_angle(np.array([0.0, 0.0, at + 0.12]), math.radians(15)) == pytest.approx(
            angle, abs=0.02
        )


def delta_angles(place):
    """Of the three arms with the base at (0, 0, -0.12); NaN where an arm does not reach."""
    try:
        return [
            arm_angle((place[0], place[1], place[2] + 0.12), math.radians(at))
            for at in (15, 135, 255)
        ]
    except ValueError:
        return [math.nan] * 3


def serial_angles(place):
    """Base, upper arm, forearm and elbow of the inverse of `place_of_handle`; NaN out of reach."""
    out, up = math.hypot(place[0], place[2] + L1), place[1] - L2
    far = math.hypot(out, up)
    inner = (L1**2 + far**2 - L2**2) / (2 * L1 * far)
    second = math.atan2(up, out) + (math.acos(inner) if abs(inner) < 1 else math.nan)
    third = math.atan2(out - L1 * math.cos(second), L1 * math.sin(second) - up)
    return [math.atan2(place[0], place[2] + L1), second, third, third - second]


@pytest.mark.parametrize(
    ("name", "size", "angles", "ranges", "missed"),
    [
        ("ideal-3", 3.0, np.array, [(-2.0, 2.0)] * 3, 0.0),
        ("falcon", 0.12, delta_angles, [(-0.5, 1.2)] * 3, 0.0),
        ("phantom-premium", 0.4, serial_angles, SERIAL_RANGES, 0.4),
    ],
)
def test_no_pose_is_called_inside_that_the_closed_form_has_outside(
    name, size, angles, ranges, missed
):
    """Of random poses. The angles of some within a serial arm's reach, far from its start, are not
    found, which the message leaves open."""
    places = np.random.default_rng(3).uniform(-size, size, (300, 3))
    low, high = np.transpose(ranges)
    q = np.array([angles(place) for place in places])
    inside = ((q > low) & (q < high)).all(axis=1)
    found = margin(device(name), places) >= 0
    assert inside.sum() > 5
    assert not (found & ~inside).any()
    assert (inside & ~found).sum() <= missed * inside.sum()


@pytest.mark.parametrize("name", ["falcon", "phantom-premium"])
def test_a_start_that_is_not_reached_is_told_with_the_pose_that_was_asked_for(name):
    """A delta's loops are open there, and the handle of a serial arm is elsewhere: neither has a
    distance to a stop."""
    scene = BAR_IN_HAND.replace("0.1] }", "0.6] }") % name
    lost = hl.run(open_scene.load(read_and_check.read_scene(scene, [])), figures=False)
    told = "haptic_device: the start pose (x m, y m, z m) = ("
    *_, third = str(lost.fault).partition(told)[2].partition(")")[0].split(", ")
    assert float(third) == pytest.approx(0.5)
    assert (
        " is outside the device's workspace, or too far from the device's own start" in lost.fault
    )
