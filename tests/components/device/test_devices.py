"""Devices of any linkage: two formulations of one device, selected directions, and the law (4.6)
with fewer motors than directions."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from hapticlink.components.blocks.controller import controller
from hapticlink.components.blocks.haptic_device import haptic_device
from hapticlink.components.blocks.motor_map import motor_map
from hapticlink.components.blocks.observer import observer
from hapticlink.components.device.device_model import DeviceModel
from hapticlink.components.device.joint_coordinates import JointCoordinates
from hapticlink.components.device.models import device_model
from hapticlink.components.device.pose_coordinates import PoseCoordinates
from hapticlink.components.device.workspace import extents_along, margin, workspace
from hapticlink.components.dynamics.rendered_directions import rendered_directions
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.control import Controller
from hapticlink.components.specs.device import Handle, Observer
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.scene.find_scene import list_shipped
from tests.blocks import Running
from tests.devices import device
from tests.mechanisms import MOBILITY as LAMBDA_INV

T = 1 / 512
PARTIAL = ("2diy", "pantograph-mk-ii", "stage", "paddle")
KINDS = {
    "twin": PoseCoordinates,
    "2diy": PoseCoordinates,
    "pantograph-mk-ii": PoseCoordinates,
    "stage": JointCoordinates,
    "paddle": JointCoordinates,
    "ideal-3": JointCoordinates,
    "falcon": JointCoordinates,
    "phantom-premium": JointCoordinates,
}
RANGED = {"joint.a_left.range": [0.5, 4.0]}


def test_every_shipped_device_has_the_coordinates_that_suit_it():
    assert KINDS.keys() == list_shipped("device").keys()
    for name, kind in KINDS.items():
        assert type(device_model(device(name))) is kind


class At:
    """A model's quantities at a pose of the handle (3,) and a velocity (k,), in numbers."""

    def __init__(self, model: DeviceModel) -> None:
        k = model.directions.size
        pose, v, guess = ca.SX.sym("x", 3), ca.SX.sym("v", k), model.place_at_pose
        z, p = guess(pose), model.numbers
        found = [
            *model.dynamics(z, v, p), model.motion(z, v, p)[1], model.jacobian(z, p),
            model.angles(z, p), model.angle_rates(z, p), model.rate(z, v, p),
        ]  # fmt: skip
        self._function = ca.Function("at", [pose, v], found, {"cse": True})

    def __call__(self, pose, v):
        return [np.array(value) for value in self._function(pose, v)]


@pytest.mark.parametrize(("name", "keys"), [("twin", RANGED), ("2diy", {})])
def test_joint_coordinates_and_dyads_are_two_ways_to_one_device(name, keys):
    """M_d, c, J_q, angles and their rates of nine and of four coordinates, by h(q) = 0, against the
    closed form; C_d of each is its own."""
    spec = device(name, keys)
    pose_model = device_model(spec)
    dyads, joints = At(pose_model), At(JointCoordinates(spec))
    k = pose_model.directions.size
    random = np.random.default_rng(7)
    for _ in range(5):
        pose = pose_model.start_pose + random.uniform(-0.02, 0.02, 3) * [1, 1, 5]
        v = random.uniform(-0.4, 0.4, k)
        one, other = dyads(pose, v), joints(pose, v)
        for i in (0, 2, 3, 4, 5):
            np.testing.assert_allclose(
                other[i], one[i], rtol=1e-9, atol=1e-11 * np.abs(one[i]).max()
            )
        np.testing.assert_allclose(other[1] @ v, other[2].ravel(), rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("name", KINDS)
def test_the_inertia_is_that_of_the_kinetic_energy(name):
    """v' M v = 2 T, with T of bodies and rotors from finite differences of their frames; and the
    rate of M less 2 C is skew."""
    spec = device(name)
    model, p = device_model(spec), device_model(spec).numbers
    n, k = len(model.start_place), model.directions.size
    z, y = ca.SX.sym("z", n), ca.SX.sym("v", k)
    frames, d = model.frames(z, p), spec.linkage.dimension
    centers = {b.name: ca.SX(ca.DM([*(b.center or (0.0, 0.0)), 0.0][:d])) for b in spec.body}
    parts = [
        ca.horzcat(frames[name].point(center), frames[name].rotation)
        for name, center in centers.items()
    ]
    placed = ca.Function("placed", [z], [ca.horzcat(*parts), model.motor_angles(z, p)])
    moved = ca.Function("moved", [z, y], [model.moved(z, y, p)])
    dynamics = ca.Function("dynamics", [z, y], [*model.dynamics(z, y, p)])
    v, small = np.array([0.3, -0.2, 2.0])[:k], 1e-6
    after, before = (moved(model.start_place, way * small * v) for way in (1, -1))
    (bodies, rotors), (bodies0, rotors0) = placed(after), placed(before)
    rates = np.split((np.array(bodies) - np.array(bodies0)) / (2 * small), len(centers), axis=1)
    at = np.split(np.array(placed(model.start_place)[0]), len(centers), axis=1)
    spins = (np.array(rotors) - np.array(rotors0)).ravel() / (2 * small)
    twice = 0.0
    for body, rate, placement in zip(spec.linkage.body, rates, at, strict=True):
        turned = placement[:, 1:].T @ rate[:, 1:]  # [omega] in the body's axes
        omega = np.zeros(3)
        omega[2] = turned[1, 0]
        if d == 3:
            omega[:2] = turned[2, 1], turned[0, 2]
        twice += body.mass * rate[:, 0] @ rate[:, 0] + omega @ body.inertia_tensor @ omega
    twice += sum(m.inertia * spin**2 for m, spin in zip(spec.motors, spins, strict=True))
    M, C = (np.array(value) for value in dynamics(model.start_place, v))
    assert v @ M @ v == pytest.approx(twice, rel=1e-6)
    rate = (np.array(dynamics(after, v)[0]) - np.array(dynamics(before, v)[0])) / (2 * small)
    assert v @ (rate - 2 * C) @ v == pytest.approx(0.0, abs=1e-6 * np.abs(M).max())


def test_a_rotor_behind_a_gear_counts_by_the_square_of_its_ratio():
    """The paddle at its pivot: its lever, 15^2 rotors, and J = 15/r at the handle."""
    spec = device("paddle")
    y = Running(haptic_device(spec)).y
    lever = 4e-5 + 0.06 * 0.02**2 + 15**2 * 2e-7
    np.testing.assert_allclose(y["M"], np.diag([lever / 0.07**2, 0.0, 0.0]), rtol=1e-12)
    tau = Running(motor_map(spec), {"F_motor": (0.5, 7.0, 3.0)}).y["tau"]
    np.testing.assert_allclose(tau, -0.5 * 0.07 / 15, rtol=1e-12)


def test_the_workspace_of_a_stage_is_its_ranges_and_that_of_a_paddle_its_arc():
    stage, paddle = device("stage"), device("paddle")
    assert workspace(stage).extent(workspace(stage).some) == (
        pytest.approx((-0.12, 0.12)),
        pytest.approx((-0.12, 0.12)),
    )
    assert margin(stage, np.array([[0.1, -0.115, 2.0]])) == pytest.approx([0.005])
    assert extents_along(paddle)[0] == pytest.approx(
        [-0.07 * np.sin(0.8), 0.07 * np.sin(0.8)], abs=1e-4
    )
    assert margin(paddle, np.array([[0.2, 0.0, 0.0]]))[0] < 0  # farther than its lever
    nowhere = device("paddle", {"joint.pivot.range": [0.9, 0.95], "handle.at": [0.0, 1e-3]})
    assert extents_along(nowhere) == [None]


@pytest.mark.parametrize("angle", ["free", "fixed"])
def test_the_mobility_that_is_felt_is_that_of_a_body_whose_angle_is_free_or_held(angle):
    """Held: by the torque that keeps its angle, found by a linear solve."""
    rendered = rendered_directions(Handle(body="b", angle=angle))
    F = np.array([0.7, -0.4, 0.0])
    a = LAMBDA_INV @ F
    if angle == "fixed":
        a = LAMBDA_INV @ (F - np.array([0, 0, a[2] / LAMBDA_INV[2, 2]]))
        assert a[2] == pytest.approx(0.0, abs=1e-14)
    found = np.array(ca.DM(rendered.mobility(ca.DM(LAMBDA_INV)))) @ F[:2]
    np.testing.assert_allclose(found, a[:2], rtol=1e-12)
    felt = rendered.felt_mobility(LAMBDA_INV)[:2, :2]
    np.testing.assert_allclose(felt @ F[:2], a[:2], rtol=1e-12)


@pytest.mark.parametrize("name", PARTIAL)
def test_a_device_with_fewer_motors_accelerates_as_the_point_would(name):
    """(4.6) with (4.5): E vdot = R (Lambda^-1 E' E F_h + a_bias), in the device's own block; what
    the hand does in other directions reaches nothing."""
    spec, start = device(name), (0.01, 0.02, 0.7)
    hand, bias = np.array([0.3, -0.2, 0.01]), np.array([0.4, 0.1, -3.0])
    plant = Running(haptic_device(spec), {"F_hand": hand}, {"x_start": start})
    y = plant.y
    law = Controller(teleoperation=False, topology=False, bias="full")
    given = {"F_hand": hand, "M": y["M"], "c": y["c"], "Lambda_inv": LAMBDA_INV, "a_bias": bias}
    u = Running(controller(law, PLANE, 0.04, handle=spec.handle), given).y["F_motor"]
    plant.set(F_motor=u)
    plant.step(1e-7)
    E = np.array(rendered_directions(spec.handle).rows)
    pushed = LAMBDA_INV @ (E.T @ E @ hand) + bias
    if spec.handle.angle == "fixed":
        pushed = pushed - LAMBDA_INV[:, 2] * pushed[2] / LAMBDA_INV[2, 2]
    found = plant.y["v_true"] / 1e-7
    np.testing.assert_allclose(E @ found, E @ pushed, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(found, E.T @ E @ found, atol=1e-12)


@pytest.mark.parametrize("name", PARTIAL)
@pytest.mark.parametrize("law", ["nicosia", "kalman"])
def test_beside_any_device_the_observer_sees_the_same_bits(name, law):
    hand = (0.05, -0.03, 0.0)

    def spec(beside):
        return replace(device(name), observer=Observer(law=law, beside=beside))

    start = {"x_start": (0.005, 0.01, 0.3)}
    within = Running(haptic_device(spec(False), True), {"F_hand": hand}, start)
    plant = Running(haptic_device(spec(True), True), {"F_hand": hand}, start)
    beside = Running(
        observer(spec(True)), {"q": plant.y["q"], "tau": plant.y["tau_applied"]}, start
    )
    torques = Running(motor_map(spec(True)))
    for k in range(40):
        F_motor = 0.02 * np.sin(0.3 * k) * np.array([1.0, 1.0, 0.0])
        within.set(F_motor=F_motor)
        beside.set(q=plant.y["q"], tau=plant.y["tau_applied"])
        seen, y = beside.y, within.y
        for output in ("x", "v", "F_hand_observed", "M", "c"):
            np.testing.assert_allclose(seen[output], y[output], rtol=1e-9, atol=1e-12)
            if device_model(device(name)).is_pose:
                assert seen[output].tobytes() == y[output].tobytes(), (output, k)
        torques.set(F_motor=F_motor, x=seen["x"])
        beside.step(T)
        plant.set(tau=torques.y["tau"])
        plant.step(T)
        within.step(T)
    assert np.abs(seen["v"]).max() > 1e-3


BAD = [
    ("twin", {"handle": {"body": "crank", "angle": "free"}}, "3 degrees of freedom"),
    ("2diy", {"handle": {"body": "left_distal", "angle": "held"}}, "2 degrees of freedom"),
    ("2diy", {"joint.left.motor": False}, "it has 1 motors for 2 directions"),
    ("2diy", {"joint.left.encoder": False}, "it has 1 encoders for 2 directions"),
    ("2diy", {"handle.angle": "fixed"}, "body `left_distal` turns as the handle moves"),
    ("2diy", {"stop.reach": 0.55}, "nothing between their two stops"),
    (
        "2diy",
        {"base": [0.0, 0.0], "joint.left.at_parent": [-1.0, 0.0]},
        "do not close near `start`",
    ),
    ("stage", {"joint.x.axis": 1.5707963267948966}, "does not move in all the 2 directions"),
]


@pytest.mark.parametrize(("name", "keys", "why"), BAD)
def test_a_device_that_does_not_fit_is_refused(name, keys, why):
    with pytest.raises(ValueError, match=why):
        device_model(device(name, keys))


def test_an_open_chain_without_ranges_is_refused():
    joints = tuple(replace(j, range=None) for j in device("stage").joint)
    with pytest.raises(ValueError, match="give the `range` of a joint"):
        device_model(replace(device("stage"), joint=joints))


@pytest.mark.parametrize(("name", "hand"), [("2diy", (0, 40.0, 0)), ("2diy", (40.0, 0, 0)),
                                            ("pantograph-mk-ii", (-30.0, -30.0, 0))])  # fmt: skip
def test_a_free_hand_that_pulls_hard_leaves_all_finite(name, hand):
    """Past the stops, to where no triangle exists."""
    plant, out = (
        Running(haptic_device(device(name, {"stop.stiffness": 20.0})), {"F_hand": hand}),
        0.0,
    )
    for _ in range(100):
        plant.step(T)
        out = min(out, plant.y["workspace_margin"])
        assert np.isfinite(plant.x).all()
    assert out < -0.02


def test_the_pantograph_is_isotropic_where_its_paper_says():
    """Campion, Wang, Hayward 2005, equation (23): at cos(theta_1) = -25/126 + 25 sqrt(2)/42 the
    motors' rates turn into velocities of one size in all directions; at about (-12.5, 101.2) mm of
    the first motor, whose x axis is the other way round."""
    pantograph = device("pantograph-mk-ii")
    found = At(device_model(pantograph))
    cosine = -25 / 126 + 25 * np.sqrt(2) / 42
    y = 0.063 * np.sqrt(1 - cosine**2) + 0.075 / np.sqrt(2)
    assert y == pytest.approx(0.1012, abs=1e-4)
    pose = [0.0, y + pantograph.base[1], 0.0]
    sizes = np.linalg.svd(found(pose, [0.0, 0.0])[-2])[1]
    assert sizes[0] / sizes[1] == pytest.approx(1.0, abs=1e-12)
    assert found(pose, [0.0, 0.0])[-3][0, 0] == pytest.approx(np.pi - np.arccos(cosine), abs=1e-12)


def test_origins_of_numbers_are_told_by_their_words():
    for name in list_shipped("device"):
        assert all(vars(device(name).origin).values())
    with pytest.raises(InputFault, match="origin: masses = 'guessed' begins with none of printed"):
        device("2diy", {"origin.masses": "guessed"})


ARM = """
handle = { body = "forearm", at = [0.12, 0.0], angle = "free" }
motor = { torque_limit = 0.1, ratio = 8.0 }
encoder = { resolution = 1e-4 }
start = { shoulder = 0.2, elbow = 1.4 }
body = [
    { name = "upper", mass = 0.12, inertia = 1.6e-4 },
    { name = "forearm", mass = 0.07, inertia = 9e-5 },
]
[[joint]]
name = "shoulder"
child = "upper"
motor = true
encoder = true

[[joint]]
name = "elbow"
parent = "upper"
child = "forearm"
at_parent = [0.13, 0.0]
motor = true
encoder = true
range = [0.3, 2.6]
"""


def serial_arm(folder, **keys):
    """A device of two links one behind the other, of 0.13 and 0.12 m."""
    (folder / "arm.toml").write_text(ARM)
    return device(str(folder / "arm.toml"), keys)


def test_a_serial_arm_counts_no_turn_of_its_elbow_that_it_has_not_made(tmp_path):
    """The elbow of two links between pivot and handle is their angle, by the law of cosines: the
    forearm's side runs from its handle back to the elbow, along -x."""
    links, arm = (0.13, 0.12), serial_arm(tmp_path)
    pose = [0.14, 0.11, 0.0]
    across = (np.hypot(*pose[:2]) ** 2 - links[0] ** 2 - links[1] ** 2) / (2 * links[0] * links[1])
    assert At(device_model(arm))(pose, [0.0, 0.0])[-3][1, 0] == pytest.approx(np.arccos(across))
    margin_there = margin(arm, np.array([pose]))[0]
    plant = Running(
        haptic_device(arm), parameters={"x_start": pose}
    )  # with parameters, not numbers
    assert plant.y["workspace_margin"] == pytest.approx(margin_there, abs=1e-12)
    assert margin_there > 0


def test_friction_behind_a_belt_brings_a_light_arm_to_rest(tmp_path):
    """A torque that changes its sign over less than a step would leave the arm shaking: 2 mN.m at
    the motors are 16 at the joints, on 1 to 3 g.m2."""
    rough = {"motor.friction": 2e-3, "joint.shoulder.range": [-1.0, 2.2]}
    pose = {"x_start": [0.14, 0.11, 0.0]}
    plant = Running(haptic_device(serial_arm(tmp_path, **rough)), parameters=pose)
    plant.set(F_hand=[0.5, 0.2, 0.0])
    for _ in range(40):
        plant.step(T)
    moving = np.abs(plant.y["v_true"]).max()
    plant.set(F_hand=[0.0, 0.0, 0.0])
    for _ in range(200):
        plant.step(T)
    assert moving > 0.01
    assert np.abs(plant.y["v_true"]).max() < 1e-3 * moving
