"""Devices in space against the closed forms that are printed for them."""

import math

import casadi as ca
import numpy as np
import pytest

from hapticlink.components.device.models import device_model
from tests.devices import device

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
