"""Controller laws: what each does to the device, exactly, and what a printed form would do."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.components.blocks.controller import controller
from hapticlink.components.blocks.haptic_device import haptic_device
from hapticlink.components.control import topology
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.control import Controller
from tests.blocks import Running
from tests.devices import device as twin
from tests.mechanisms import MOBILITY as LAMBDA_INV
from tests.mechanisms import WRENCH

L = 0.042
F_HAND = np.array(WRENCH)
M = np.array([[0.27, 0.012, 4e-4], [0.012, 0.24, -3e-4], [4e-4, -3e-4, 3.1e-4]])
ALONE = {"teleoperation": False, "topology": False}
directions = st.lists(st.tuples(*[st.floats(-1, 1)] * 3), min_size=0, max_size=3)
# Squares of much smaller numbers underflow.
moderate = st.floats(-5, 5).map(lambda v: v if abs(v) > 1e-100 else 0.0)
pulls = st.tuples(*[moderate] * 3)


def block(inputs, parameters=None, **spec):
    return Running(controller(Controller(**spec), PLANE, L), inputs, parameters)


def names(variables):
    return [v.name for v in variables]


def projector(vectors):
    """Orthogonal projector on the span of some independent vectors."""
    basis = np.zeros((3, 0))
    for v in vectors:
        rest = np.array(v) - basis @ (basis.T @ v)
        if np.linalg.norm(rest) > 0.1:
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
    return basis @ basis.T


def constrained(length_scale):
    """P_c of a mechanism that resists one wrench direction, in coordinates scaled by L."""
    S = np.diag([1, 1, length_scale])
    _, vector = np.linalg.eigh(S @ LAMBDA_INV @ S)
    n = vector[:, [0]]
    return n @ n.T


_symbols = [ca.SX.sym("pull", 3), ca.SX.sym("M", 3, 3), ca.SX.sym("P", 3, 3), ca.SX.sym("L")]
_wrench = ca.Function("F_T", _symbols, [topology.constraint_wrench(PLANE, *_symbols)])


def constraint_map(P, length_scale=L):
    return np.column_stack([np.array(_wrench(e, M, P, length_scale)) for e in np.eye(3)])


def test_device_at_rest_accelerates_like_the_mechanism():
    """(4.4) by (4.5) and the corrected (4.6): xdd = Lambda^-1 F_h, in the device's own block."""
    start = (-0.02, 0.01, 0.7)
    device = Running(haptic_device(twin()), {"F_hand": F_HAND}, {"x_start": start})
    y = device.y
    u = block({"F_hand": F_HAND, "M": y["M"], "c": y["c"], "Lambda_inv": LAMBDA_INV}, **ALONE).y[
        "F_motor"
    ]
    expected = LAMBDA_INV @ F_HAND
    np.testing.assert_allclose(np.linalg.solve(y["M"], u + F_HAND - y["c"]), expected, rtol=1e-12)
    device.set(F_motor=u)
    device.step(1e-6)
    np.testing.assert_allclose(device.y["v"] / 1e-6, expected, rtol=1e-6)
    # as printed, F_HD of (4.3) holds F_h and (4.6) adds (M Lambda^-1 - I) F_h once more
    printed = (y["M"] @ LAMBDA_INV - np.eye(3)) @ F_HAND + y["M"] @ LAMBDA_INV @ F_HAND
    wrong = np.linalg.solve(y["M"], printed + F_HAND)
    np.testing.assert_allclose(wrong, 2 * expected, rtol=1e-9)


def test_moving_device_accelerates_like_the_mechanism():
    """With C_d v sent, the velocity does not show."""
    device = Running(haptic_device(twin()), {"F_hand": F_HAND}).put(v_true=(0.2, -0.1, 6.0))
    y, v = device.y, device.y["v"]
    assert np.abs(np.linalg.solve(y["M"], y["c"])).max() > 0.1
    inputs = {"F_hand": F_HAND, "M": y["M"], "c": y["c"], "Lambda_inv": LAMBDA_INV}
    device.set(F_motor=block(inputs, **ALONE).y["F_motor"])
    device.step(1e-7)
    np.testing.assert_allclose((device.y["v"] - v) / 1e-7, LAMBDA_INV @ F_HAND, rtol=1e-4)


def test_whole_law():
    rng = np.random.default_rng(5)
    x_S, v_S, x_D, v_D, F_env, c, a_bias, x_ref = rng.normal(size=(8, 3)) * [1, 1, 10] / 10
    P_c = constrained(L)
    K_pc, B_pc = np.array([100, 100, 0.5]), np.array([70, 70, 0.375])
    B_d, K_d = np.array([1.0, 2, 0.01]), np.array([30.0, 20, 0.1])
    running = block(
        dict(x_S=x_S, v_S=v_S, x_D=x_D, v_D=v_D, F_hand=F_HAND, F_env=F_env, M=M, c=c)
        | dict(Lambda_inv=LAMBDA_INV, P_c=P_c, a_bias=a_bias),
        {"x_ref": x_ref},
        bias="full",
        contact=True,
        damping=tuple(B_d),
        stiffness=tuple(K_d),
    )
    y = running.y
    F_drift = K_pc * (x_S - x_D) + B_pc * (v_S - v_D)
    S = np.diag([1, 1, L])
    S_inv = np.linalg.inv(S)
    M_s_inv = np.linalg.inv(S_inv @ M @ S_inv)
    pull = 200 * (x_S - x_D) + 50 * (v_S - v_D)
    F_T = S @ np.linalg.pinv(P_c @ M_s_inv @ P_c, rcond=1e-9) @ S @ pull
    force = F_HAND + F_drift + F_env - B_d * v_D - K_d * (x_D - x_ref)
    u = M @ LAMBDA_INV @ force + M @ a_bias + c - F_HAND + F_T
    np.testing.assert_allclose(y["F_drift"], F_drift, rtol=1e-12)
    np.testing.assert_allclose(y["F_constraint"], F_T, rtol=1e-9)
    np.testing.assert_allclose(y["F_motor"], u, rtol=1e-9)


def test_without_impedance_the_wrenches_act_as_they_are():
    x_S = np.array([0.01, 0.02, 0.3])
    y = block({"x_S": x_S, "F_env": (1, 2, 3)}, impedance=False, topology=False, contact=True).y
    np.testing.assert_allclose(y["F_motor"], (2.0, 4.0, 3.15), rtol=1e-12)


@pytest.mark.parametrize(
    ("spec", "inputs", "parameters", "outputs"),
    [
        ({"impedance": False} | ALONE, [], [], ["F_motor"]),
        (ALONE, ["F_hand", "M", "c", "Lambda_inv"], [], ["F_motor"]),
        (
            ALONE | {"bias": "full", "damping": (0, 0, 0)},
            ["v_D", "F_hand", "M", "c", "Lambda_inv", "a_bias"],
            ["B_d"],
            ["F_motor"],
        ),
        (
            {"impedance": False, "topology": False},
            ["x_S", "v_S", "x_D", "v_D"],
            ["K_pc", "B_pc"],
            ["F_motor", "F_drift"],
        ),
        (
            {"impedance": False, "teleoperation": False},
            ["x_S", "v_S", "x_D", "v_D", "M", "P_c"],
            ["k_j", "b_j", "length_scale"],
            ["F_motor", "F_constraint"],
        ),
        (
            ALONE | {"impedance": False, "stiffness": (1, 1, 1)},
            ["x_D"],
            ["K_d", "x_ref"],
            ["F_motor"],
        ),
    ],
)
def test_a_part_left_out_leaves_nothing(spec, inputs, parameters, outputs):
    component = controller(Controller(**spec), PLANE, L)
    assert names(component.inputs) == inputs
    assert names(component.parameters) == parameters
    assert names(component.outputs) == outputs
    assert not component.states


@given(directions)
def test_constraint_map_is_symmetric_and_semidefinite(vectors):
    G = constraint_map(projector(vectors))
    np.testing.assert_allclose(G, G.T, atol=1e-14)
    assert np.linalg.eigvalsh(G)[0] > -1e-14


@given(directions, pulls, pulls)
def test_constraint_wrench_does_no_work_on_free_motion(vectors, pull, motion):
    P, S = projector(vectors), np.diag([1, 1, L])
    free = np.linalg.solve(S, (np.eye(3) - P) @ motion)
    F_T = constraint_map(P) @ pull
    size = np.linalg.norm(motion) * np.linalg.norm(S @ pull)  # of parts that may cancel
    assert abs(F_T @ free) <= 1e-12 * size


def test_constraint_wrench_does_no_work_on_free_motion_at_any_scale():
    """On the report's own Lambda^-1."""
    pull = np.array([1.0, -2.0, 30.0])
    free = LAMBDA_INV @ np.array([1.0, 0.5, -0.05])  # any motion that the mechanism can make
    F_T = {n: constraint_map(constrained(n), n) @ pull for n in (0.02, L, 0.3)}
    assert abs(F_T[L] @ free) < 1e-10 * np.linalg.norm(F_T[L]) * np.linalg.norm(free)
    for n in (0.02, 0.3):
        np.testing.assert_allclose(F_T[n], F_T[L], rtol=1e-8)


@given(pulls)
def test_constraint_wrench_at_both_ends(pull):
    """No constrained direction: no wrench. All: the device's whole inertia, M_d pull."""
    np.testing.assert_array_equal(constraint_map(np.zeros((3, 3))) @ pull, 0)
    np.testing.assert_allclose(constraint_map(np.eye(3)) @ pull, M @ pull, atol=1e-13)


def test_constraint_wrench_accelerates_the_device_by_the_pull_where_resisted():
    """P S M_d^-1 F_T = P S pull: the constrained directions get k_j e + b_j edot."""
    P, S, pull = projector([(1, 0.3, -0.5), (0, 1, 1)]), np.diag([1, 1, L]), [0.4, -1.0, 20.0]
    F_T = constraint_map(P) @ pull
    np.testing.assert_allclose(P @ S @ np.linalg.solve(M, F_T), P @ S @ pull, rtol=1e-10)
