"""Two users who hold the ends of a bar that floats, each through the ideal device of three forces,
against the equations of Newton and Euler of a rigid body, written here:

m a = F_1 + F_2,   J omegadot + omega x J omega = r_1 x F_1 + r_2 x F_2

with J = R diag(I) R' about the centre of mass, and r_k from it to what user k holds."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hapticlink as hl
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene import read_and_check

MASS, INERTIA, ENDS = 2.0, np.array([0.012, 0.03, 0.04]), (0.25, -0.15)
SCENE = f"""
title = "A bar that floats, in two hands"
duration = 0.5
haptics.rate = 512
graphics.rate = 32
record.signals = "all"

[linkage]
operational_point = {{ body = "bar", at = [{ENDS[0]}, 0.0, 0.0] }}

[[linkage.body]]
name = "bar"
mass = {MASS}
inertia = {INERTIA.tolist()}

[[linkage.joint]]
name = "bar"
type = "floating"
child = "bar"

[[linkage.point]]
name = "left"
body = "bar"
at = [{ENDS[1]}, 0.0, 0.0]

[controller]
bias = "full"

[controller.teleoperation]
stiffness = [200.0, 200.0, 200.0]
damping = [20.0, 20.0, 20.0]

[device]
extends = "ideal-3"

[devices.left]
extends = "ideal-3"

[hand]
type = "spring"
stiffness = [100.0, 100.0, 100.0]
damping = [5.0, 5.0, 5.0]
target = [[0.0, {ENDS[0]}, 0.0, 0.0], [0.2, 0.2, 0.1, 0.1]]

[hands.left]
type = "spring"
stiffness = [100.0, 100.0, 100.0]
damping = [5.0, 5.0, 5.0]
target = [[0.0, {ENDS[1]}, 0.0, 0.0], [0.3, -0.1, 0.0, -0.2]]
"""


def run(**options):
    return hl.run(open_scene.load(read_and_check.read_scene(SCENE, [])), options, figures=False)


@pytest.fixture(scope="module")
def found():
    return run()


def cross(r):
    """The matrix of r x."""
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def rates(y, forces):
    """Of centre, R, its velocity and omega, under the `forces` (2, 3) at the ends; and the
    mobility (6, 6) of both, with what they accelerate by without forces (6,)."""
    R, v, omega = y[3:12].reshape(3, 3), y[12:15], y[15:]
    J, r = R @ np.diag(INERTIA) @ R.T, [R[:, 0] * end for end in ENDS]
    moved = np.vstack([np.hstack([np.eye(3), -cross(at)]) for at in r])
    inverse = np.zeros((6, 6))
    inverse[:3, :3], inverse[3:, 3:] = np.eye(3) / MASS, np.linalg.inv(J)
    spin = -np.linalg.solve(J, np.cross(omega, J @ omega))
    a = inverse @ moved.T @ np.ravel(forces) + np.concatenate([np.zeros(3), spin])
    alone = [np.cross(omega, np.cross(omega, at)) + np.cross(spin, at) for at in r]
    dy = np.concatenate([v, (cross(omega) @ R).ravel(), a])
    return dy, moved @ inverse @ moved.T, np.ravel(alone)


def integrated(forces, h):
    """The states under forces (n, 2, 3) that are held for h (s) each."""
    y = np.concatenate([np.zeros(3), np.eye(3).ravel(), np.zeros(6)])
    yield y
    for on in forces[:-1]:
        step = solve_ivp(lambda _t, y, on=on: rates(y, on)[0], (0, h), y, rtol=1e-10, atol=1e-12)
        y = step.y[:, -1]
        yield y


def of_both(found, port, *, block="virtual_mechanism", own=True):
    """A signal of both users, (n, 2, 3)."""
    names = (f"{block}.{port}", f"{block}.left.{port}" if own else f"{block}_left.{port}")
    return np.stack([found[name] for name in names], axis=1)


def test_both_hands_move_a_bar_as_newton_and_euler_have_it(found):
    """What the mechanism is given are the hands' forces less those of the couplings: where both
    points go, their accelerations without forces, and the force that has the effect of the other
    user's at a point, are those of the rigid body."""
    assert found.run["end"]["reason"] == "duration"
    forces = of_both(found, "F", block="hand", own=False)
    forces = forces - of_both(found, "F_drift", block="controller", own=False)
    states = list(integrated(forces, 1 / 512))
    ends = [[y[:3] + y[3:12].reshape(3, 3)[:, 0] * end for end in ENDS] for y in states]
    assert np.ptp(ends, axis=0).max() > 0.05
    assert of_both(found, "x") == pytest.approx(np.array(ends), rel=0, abs=1e-6)
    _, mobility, alone = map(np.array, zip(*map(rates, states, forces), strict=True))
    near = {"rel": 0, "abs": 1e-4 * np.abs(alone).max()}
    assert of_both(found, "a_bias") == pytest.approx(alone.reshape(-1, 2, 3), **near)
    felt = of_both(found, "F_env")[1:]  # by the forces of the step that ended
    for k, (own, other) in enumerate([(slice(0, 3), slice(3, 6)), (slice(3, 6), slice(0, 3))]):
        across = mobility[1:, own, other] @ forces[:-1, 1 - k, :, None]
        wanted = np.linalg.solve(mobility[1:, own, own], across)[..., 0]
        assert np.abs(wanted).max() > 1.0
        assert felt[:, k] == pytest.approx(wanted, rel=0, abs=1e-4 * np.abs(wanted).max())


def test_both_handles_follow_their_points_the_nearer_the_shorter_the_frames(found):
    def apart(of):
        far = of_both(of, "x") - of_both(of, "x_true", block="haptic_device", own=False)
        return np.linalg.norm(far, axis=2).max(axis=0)

    slow, fast = apart(found), apart(run(graphics={"rate": 128}))
    assert (slow < 0.05 * np.ptp(of_both(found, "x"), axis=0).max()).all()
    assert (fast < 0.5 * slow).all()
