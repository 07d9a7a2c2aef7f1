"""The haptic device as a block: motion, sensing, and what it leaves out."""

import typing
from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hapticlink.components.blocks.haptic_device import haptic_device
from hapticlink.components.specs.device import Motor, Observer, Stops
from hapticlink.components.specs.quantities import Quantity
from tests.blocks import Running, advance
from tests.devices import device as twin
from tests.reference import twin_pantograph

T = 1 / 512
START = (-0.02, 0.01, 3.6)


@cache
def ideal():
    return haptic_device(twin())


@cache
def counting():
    """With encoders and an observer."""
    return haptic_device(twin(), encoders=True)


@cache
def alone():
    """Without its observer, which is beside it."""
    return haptic_device(replace(twin(), observer=Observer(beside=True)), encoders=True)


def at_start(component, **inputs):
    return Running(component, inputs, {"x_start": START})


def base_jacobian(pose):
    at = ca.SX.sym("pose", 3)
    J = twin_pantograph.jacobian(at, twin_pantograph.NUMBERS)
    return np.array(ca.Function("J", [at], [J])(pose))


def test_starts_at_rest_at_x_start():
    for component in (ideal(), counting(), alone()):
        y = at_start(component).y
        np.testing.assert_array_equal(y["x_true"], START)
        for name in {"v", "v_true", "F_hand_observed", "c", "tau_applied"} & {*y}:
            np.testing.assert_array_equal(y[name], 0)


def test_ideal_sensing_has_no_encoder_and_no_observer():
    assert [v.name for v in ideal().states] == ["x_true", "v_true"]
    names = {v.name for v in ideal().parameters}
    assert names.isdisjoint({"encoder_resolution", "omega_n", "k_D"})
    y = advance(at_start(ideal(), F_hand=(0.3, -0.2, 0.001), F_motor=(0.1, 0.1, 0)), 50 * T, 512).y
    np.testing.assert_array_equal(y["x"], y["x_true"])
    np.testing.assert_array_equal(y["v"], y["v_true"])
    assert "F_hand_observed" not in y


def test_a_device_without_observer_puts_out_what_encoders_count_and_motors_have_given():
    torques = (0.01, -0.02, 0.03, 0.005)
    device = at_start(alone(), tau=torques)
    before = device.y["tau_applied"]
    for _ in range(64):
        device.step(T)
    y, resolution = device.y, twin_pantograph.NUMBERS["encoder_resolution"]
    np.testing.assert_array_equal(before, 0)
    np.testing.assert_array_equal(y["tau_applied"], torques)
    np.testing.assert_array_equal(y["counts"], np.rint(y["counts"]))
    np.testing.assert_array_equal(y["q"], resolution * y["counts"])
    assert 0 < np.abs(y["q"] - y["q_true"]).max() <= resolution / 2
    at = ca.SX.sym("pose", 3)
    angles = ca.Function("q", [at], [twin_pantograph.base_angles(at, twin_pantograph.NUMBERS)])
    np.testing.assert_allclose(y["q_true"], np.array(angles(y["x_true"])).ravel(), rtol=1e-15)


def test_acceleration_from_rest_is_force_over_inertia():
    wrench, motor = np.array([0.3, -0.2, 0.001]), np.array([-0.1, 0.4, -0.002])
    device = at_start(ideal(), F_hand=wrench, F_motor=motor)
    M = device.y["M"]
    device.step(1e-6)
    np.testing.assert_allclose(device.y["v"] / 1e-6, np.linalg.solve(M, wrench + motor), rtol=1e-8)


def test_held_torques_against_scipy():
    """One long step: the torques of t_k stay, so the wrench turns with J_q; substeps of Heun's
    method converge to DOP853 at second order."""
    wrench, motor, h = np.array([0.1, 0.2, 0.001]), np.array([-0.4, 0.3, 0.004]), 0.04
    reference = at_start(ideal())
    x0 = np.r_[reference.x[:3], 0.2, -0.1, 3.0]
    J0 = base_jacobian(x0[:3])
    tau = J0 @ np.linalg.solve(J0.T @ J0, motor)

    def rate(_, x):
        reference.x = x
        y = reference.y
        F = base_jacobian(x[:3]).T @ tau + wrench - y["c"]
        return np.concatenate([x[3:], np.linalg.solve(y["M"], F)])

    expected = solve_ivp(rate, (0, h), x0, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    errors, substeps = [], (8, 16, 32)
    for n in substeps:
        device = at_start(haptic_device(twin(substeps=n)), F_hand=wrench, F_motor=motor)
        device.put(v_true=x0[3:])
        device.step(h)
        errors.append(np.abs(device.x - expected).max())
    assert errors[0] < 1e-5
    slope = np.polyfit(np.log(substeps), np.log(errors), 1)[0]
    assert slope == pytest.approx(-2, abs=0.15)
    J1 = base_jacobian(expected[:3])
    assert np.abs(J1.T @ tau - motor).max() > 1e-3  # a held wrench would be something else


def test_energy_balance_under_a_force():
    """Work of hand and motors equals the kinetic energy gained, to the integrator's error."""
    device = at_start(ideal(), F_hand=(0.3, -0.1, 0.002))
    work = 0.0
    for _ in range(100):
        before = device.y["x_true"]
        device.step(T)
        work += np.array((0.3, -0.1, 0.002)) @ (device.y["x_true"] - before)
    v = device.y["v_true"]
    assert v @ device.y["M"] @ v / 2 == pytest.approx(work, rel=2e-6)


def test_measured_pose_is_within_a_count():
    """One count is 0.15 to 0.21 mm and 4 to 5 mrad: half a count on each encoder at most."""
    device = at_start(counting(), F_hand=(0.1, -0.05, 0.0004))
    seen, errors = set(), []
    for _ in range(256):
        device.step(T)
        y = device.y
        errors.append(y["x"] - y["x_true"])
        seen.add(tuple(np.round(y["x"], 9)))
    errors = np.abs(errors)
    assert errors[:, :2].max() < 0.25e-3
    assert errors[:, 2].max() < 6e-3
    assert errors[:, :2].max() > 1e-6
    assert 20 < len(seen) < 256  # quantised: it stays while no encoder counts


def test_theta_is_continuous_over_many_turns():
    device = at_start(counting()).put(v_true=(0, 0, 12.0))
    for _ in range(600):
        x, v = device.state["x_true"] - START, device.state["v_true"]
        device.set(F_motor=(*(-40 * x[:2] - 4 * v[:2]), 0))
        device.step(T)
    y = device.y
    assert y["x_true"][2] - START[2] > 2 * np.pi
    assert abs(y["x"][2] - y["x_true"][2]) < 6e-3


@pytest.mark.parametrize(
    "own", [*({"rule": r} for r in ("forward", "backward", "trapezoidal")), {"law": "kalman"}]
)
def test_observer_converges_to_a_constant_force(own):
    """The motors balance the hand: the device stays, and the observed force is the hand's."""
    component = haptic_device(
        replace(twin(keys={"encoder.resolution": 1e-6}), observer=Observer(**own, omega_n=50.0)),
        encoders=True,
    )
    hand = np.array([0.4, -0.3, 0.003])
    device = advance(at_start(component, F_hand=hand, F_motor=-hand), 1.0, 512)
    np.testing.assert_allclose(device.y["F_hand_observed"], hand, atol=2e-3 * np.abs(hand).max())
    np.testing.assert_allclose(device.y["v"], device.y["v_true"], atol=2e-3)
    np.testing.assert_allclose(device.y["v_true"], 0, atol=4e-3)


@pytest.mark.parametrize("law", ["nicosia", "kalman"])
def test_observer_follows_a_moving_device(law):
    """A free push for 0.2 s, encoders of 0.09 degrees: force to .1 N, velocity to 10 mm/s."""
    hand = np.array([-0.3, 0.1, -0.001])
    device = at_start(haptic_device(replace(twin(), observer=Observer(law=law)), True), F_hand=hand)
    forces, velocities = [], []
    for k in range(120):
        device.step(T)
        if k > 80:
            y = device.y
            forces.append(y["F_hand_observed"] - hand)
            velocities.append(y["v"] - y["v_true"])
    assert np.abs(np.mean(forces, axis=0))[:2].max() < 0.03
    assert np.abs(velocities)[:, :2].max() < 0.02


def test_workspace_margin_and_stop():
    """Pushed out at full reach the margin goes negative and the stop holds the handle."""
    device = at_start(ideal(), F_hand=(0, 4.0, 0), F_motor=(0, 0, 0))
    least = np.inf
    for _ in range(1024):
        device.set(F_hand=(0, 4.0 - 5 * device.y["v"][1], -0.01 * device.y["v"][2]))
        device.step(T)
        least = min(least, device.y["workspace_margin"])
    assert -0.01 < least < 0
    assert np.isfinite(device.x).all()


def test_a_parameter_has_the_unit_that_the_scene_s_key_declares():
    rough = twin(keys={"motor.friction": 0.01})
    keys = {
        "rotor_inertia": (Motor, "inertia"),
        "torque_limit": (Motor, "torque_limit"),
        "motor_damping": (Motor, "damping"),
        "motor_friction": (Motor, "friction"),
        "stop_reach": (Stops, "reach"),
        "stop_stiffness": (Stops, "stiffness"),
        "stop_damping": (Stops, "damping"),
    }
    found = {p.name: p.unit for p in haptic_device(rough, encoders=True).parameters}
    for name, (record, key) in keys.items():
        hint = typing.get_type_hints(record, include_extras=True)[key]
        quantities = [
            each
            for part in (hint, *typing.get_args(hint))
            for each in getattr(part, "__metadata__", ())
            if isinstance(each, Quantity)
        ]
        assert found[name] == quantities[0].unit
