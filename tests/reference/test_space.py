"""Linkages in space against Pinocchio's terms, published numbers and conserved quantities.

Pinocchio has its own coordinates for balls: what is compared does not depend on coordinates.
"""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from benchmarks.mechanism.errors import tip_of_bennett
from benchmarks.mechanisms import bennett, bricard
from benchmarks.our_mechanism import Ours
from benchmarks.peers import mujoco_peer, pinocchio_peer
from hapticlink.components.blocks.virtual_mechanism import virtual_mechanism
from hapticlink.components.dynamics.assembly import AssemblyError, start_coordinates
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.linkage.rotations import X_AXIS, Y_AXIS, Z_AXIS, unit
from hapticlink.components.specs.joint_types import JOINT_TYPES
from hapticlink.components.specs.linkage import (
    Body,
    Joint,
    Linkage,
    Loop,
    Mechanism,
    OperationalPoint,
)
from tests.components.linkage.test_lifted import accelerations
from tests.mechanisms import evaluated
from tests.spatial_linkages import (
    DELTA,
    delta,
    governor,
    rssr,
    sarrus,
    slider_crank,
    top,
)

WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def at(point):
    return pin.SE3(np.eye(3), np.array((*(point or (0.0, 0.0)), 0.0)[:3]))


def rotation_of_ball(q):
    """The rotation by 4 atan(|q|/4) about q, by Pinocchio's exponential."""
    size = np.linalg.norm(q)
    return pin.exp3(4 * math.atan(size / 4) * q / size) if size else np.eye(3)


def depth_first(joints, body="ground"):
    """Pinocchio numbers a subtree without gaps."""
    return [j for k in joints if k.parent == body for j in (k, *depth_first(joints, k.child))]


class Reference:
    """A linkage as Pinocchio's tree: a joint for each turn and slide, a ball as spherical."""

    def __init__(self, linkage):
        self.linkage, self.model = linkage, pin.Model()
        self.model.gravity.linear = np.array((*(linkage.gravity or (0.0, 0.0)), 0.0)[:3])
        self.bodies = {"ground": (0, pin.SE3.Identity())}
        self.joints = depth_first(linkage.joint)
        for joint in self.joints:
            parent, frame = self.bodies[joint.parent]
            placement = frame * at(joint.at_parent)
            for k, kind in enumerate(self.kinds(joint)):
                parent = self.model.addJoint(parent, kind, placement, f"{joint.name}.{k}")
                placement = pin.SE3.Identity()
            back = at(tuple(-x for x in joint.at_child or (0.0, 0.0)))
            self.bodies[joint.child] = parent, back
            body = next(b for b in linkage.body if b.name == joint.child)
            inertia = pin.Inertia(body.mass, np.zeros(3), body.inertia_tensor)
            self.model.appendBodyToJoint(parent, inertia, back * at(body.center))
        self.data = self.model.createData()

    def kinds(self, joint):
        slides = [f for f in joint.kind.freedoms if f.slides]
        for freedom in slides:
            along = freedom.along if isinstance(freedom.along, tuple) else joint.axis
            yield pin.JointModelPrismaticUnaligned(np.array(unit(along)))
        for freedom in joint.kind.freedoms:
            if freedom.turns and freedom.about != "ball":
                of = joint.second_axis if freedom.about == "second_axis" else joint.axis
                yield pin.JointModelRevoluteUnaligned(np.array(unit(of)))
        if joint.kind.balls:
            yield pin.JointModelSpherical()

    def state(self, q, qd):
        """Pinocchio's (q, v): of a ball the quaternion, and its rate by differences."""
        ours, rates, own_of = iter(zip(q, qd, strict=True)), [[], []], {}
        for joint in self.linkage.joint:
            own_of[joint.name] = [next(ours) for _ in range(joint.kind.size)]
        for joint in self.joints:
            own = own_of[joint.name]
            single = joint.kind.size - 3 * len(joint.kind.balls)
            for value, rate in own[:single]:
                rates[0].append(value)
                rates[1].append(rate)
            if joint.kind.balls:
                ball, rate = (np.array(of) for of in zip(*own[single:], strict=True))
                h = 1e-4
                ends = [rotation_of_ball(ball + s * h * rate) for s in (-2, -1, 1, 2)]
                R = rotation_of_ball(ball)
                slope = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
                rates[0] += pin.Quaternion(R).coeffs().tolist()
                rates[1] += pin.unSkew(R.T @ slope).tolist()
        return np.array(rates[0]), np.array(rates[1])

    def frame(self, body, point=None):
        joint, placement = self.bodies[body]
        return self.model.addFrame(
            pin.Frame(f"f{self.model.nframes}", joint, 0, placement * at(point), pin.OP_FRAME)
        )

    def jacobian(self, frame):
        J = pin.getFrameJacobian(self.model, self.data, frame, WORLD).reshape(6, -1)
        return J, self.data.oMf[frame].rotation

    def mobility(self, q):
        """(Lambda^-1, W) at the operational point, by least norm."""
        held = self.linkage.held
        op, ends = self.frame(held.body, held.at), []
        for loop in self.linkage.loop:
            ends.append([self.frame(b, p) for b, p in zip(loop.bodies, loop.at, strict=True)])
        self.data = self.model.createData()
        there, _ = self.state(q, np.zeros(len(q)))
        D = pin.crba(self.model, self.data, there)
        D = np.triu(D) + np.triu(D, 1).T
        pin.computeJointJacobians(self.model, self.data, there)
        pin.updateFramePlacements(self.model, self.data)
        rows = []
        for loop, (first, second) in zip(self.linkage.loop, ends, strict=True):
            (J0, _), (J1, R1) = self.jacobian(first), self.jacobian(second)
            gap = self.data.oMf[first].translation - self.data.oMf[second].translation
            if loop.type == "rod":
                rows.append((gap / np.linalg.norm(gap) @ (J0 - J1)[:3])[None])
                continue
            rows.append((J0 - J1)[:3])
            if loop.type == "revolute":
                across = np.linalg.svd(np.array(loop.axes[1])[None])[2][1:] @ R1.T
                rows.append(across @ (J0 - J1)[3:])
        W, n = np.vstack(rows), len(D)
        J = self.jacobian(op)[0][:3]
        K = np.block([[D, -W.T], [W, np.zeros((len(W), len(W)))]])
        right = np.vstack([J.T, np.zeros((len(W), 3))])
        return J @ np.linalg.lstsq(K, right, rcond=1e-11)[0][:n], W


@pytest.mark.parametrize(
    ("linkage", "n", "rows", "rank", "mobile"),
    [
        (bricard(), 5, 5, 4, 1),
        (bennett(), 3, 5, 2, 1),
        (sarrus(), 5, 4, 4, 1),
        (rssr(), 5, 3, 3, 1),
        (rssr("rod"), 2, 1, 1, 1),
    ],
    ids=["bricard", "bennett", "sarrus", "rssr", "rssr with a rod"],
)
def test_mobility_of_overconstrained_loops(linkage, n, rows, rank, mobile):
    """Coordinates, closure rows, their rank, and Lambda^-1 against Pinocchio's."""
    q = start_coordinates(linkage)
    of = evaluated(linkage, lambda m: [OperationalSpace(m).Lambda_inv, m.W])
    found, W = of(q, np.zeros(len(q)))
    wanted, _ = Reference(linkage).mobility(q)
    assert (len(q), len(W), np.linalg.matrix_rank(W, 1e-9)) == (n, rows, rank)
    assert np.linalg.matrix_rank(found, 1e-9 * np.abs(wanted).max()) == mobile
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


def tree(rng):
    """Every type of a joint in space once, in a random tree, with axes and inertias at random."""

    def point():
        return tuple(rng.uniform(-0.5, 0.5, 3).tolist())

    bodies, joints, start = [], [], {}
    kinds = [name for name, kind in JOINT_TYPES.items() if kind.in_space and name != "rod"]
    for i, name in enumerate(rng.permutation([*kinds, "revolute", "prismatic"])):
        half = rng.normal(size=(3, 3))
        second = half @ half.T * 0.02
        tensor = np.trace(second) * np.eye(3) - second
        entries = (*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2])
        of_body = {"mass": float(rng.uniform(0.2, 2)), "inertia": tuple(map(float, entries))}
        bodies.append(Body(name=f"b{i}", center=point(), **of_body))
        given = {"axis": point()} if JOINT_TYPES[name].axes else {}
        given |= {"second_axis": point()} if JOINT_TYPES[name].axes == 2 else {}
        parent = "ground" if i == 0 else f"b{rng.integers(max(0, i - 2), i)}"
        where = {"at_parent": point(), "at_child": point()}
        joint = Joint(name=f"j{i}", type=str(name), parent=parent, child=f"b{i}", **where, **given)
        joints.append(joint)
    held = OperationalPoint(body=f"b{len(bodies) - 1}", at=point())
    return Linkage(
        body=tuple(bodies),
        joint=tuple(joints),
        operational_point=held,
        gravity=(1.0, -2.0, -9.81),
        start=start,
    )


@pytest.mark.parametrize("seed", range(3))
def test_accelerations_of_trees_with_every_type_of_joint(seed):
    """Acceleration of a point on the last body in motion, and its mobility, against Pinocchio's
    articulated-body algorithm, with centripetal and Coriolis terms and gravity."""
    rng = np.random.default_rng(seed)
    linkage = tree(rng)
    n = len(linkage.coordinate_units)
    q, qd = rng.uniform(-1.5, 1.5, n), rng.uniform(-2.0, 2.0, n)

    def expressions(model):
        space = OperationalSpace(model)
        return [space.a_bias, space.Lambda_inv, model.x_h, model.v_h, model.kinetic_energy]

    a_bias, mobility, x, v, energy = (of.squeeze() for of in evaluated(linkage, expressions)(q, qd))
    theirs = Reference(linkage)
    frame = theirs.frame(linkage.held.body, linkage.held.at)
    theirs.data, (there, rate) = theirs.model.createData(), theirs.state(q, qd)
    zero = np.zeros(theirs.model.nv)
    a = pin.aba(theirs.model, theirs.data, there, rate, zero)
    assert energy == pytest.approx(
        pin.computeKineticEnergy(theirs.model, theirs.data, there, rate), rel=1e-9
    )
    pin.forwardKinematics(theirs.model, theirs.data, there, rate, a)
    pin.updateFramePlacements(theirs.model, theirs.data)
    motion = pin.getFrameClassicalAcceleration(theirs.model, theirs.data, frame, WORLD)
    np.testing.assert_allclose(x, theirs.data.oMf[frame].translation, atol=1e-12)
    moved = pin.getFrameVelocity(theirs.model, theirs.data, frame, WORLD).linear
    np.testing.assert_allclose(v, moved, rtol=0, atol=1e-9 * np.abs(v).max())
    np.testing.assert_allclose(a_bias, motion.linear, rtol=0, atol=1e-8 * np.abs(a_bias).max())
    D = pin.crba(theirs.model, theirs.data, there)
    pin.computeJointJacobians(theirs.model, theirs.data, there)
    J = theirs.jacobian(frame)[0][:3]
    wanted = J @ np.linalg.solve(np.triu(D) + np.triu(D, 1).T, J.T)
    np.testing.assert_allclose(mobility, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


def run(linkage, steps, h, integrator="rk4"):
    """States over time by column, and a function of the outputs by name."""
    component = virtual_mechanism(linkage, Mechanism(integrator=integrator))
    u = np.zeros(sum(v.size for v in component.inputs))
    p = component.start_parameters
    x = np.array(component.initialize(u, p)).ravel()
    names = [name for v in component.outputs for name in v.names]
    states = [x]
    for _ in range(steps):
        x = np.array(component.step(x, u, p, 0.0, h)).ravel()
        states.append(x)
    columns = np.array([np.array(component.output(x, u, p, 0.0)).ravel() for x in states])
    return dict(zip(names, columns.T, strict=True)), np.array(states)


@pytest.mark.slow
def test_bricard_of_the_library_of_benchmarks():
    """IFToMM benchmark A04 at 1 kHz: P3 after 10 s as by a method of order 5 with error control on
    Pinocchio's terms, the period, energy and gap."""
    found, states = run(bricard(), 10000, 1e-3)
    P3 = [found[f"x[{i}]"][-1] for i in (1, 2, 3)]
    np.testing.assert_allclose(P3, [0.999730987, -0.999999964, -0.000268976], rtol=0, atol=1e-9)
    assert np.ptp(found["energy"]) < 1e-10
    assert found["closure_error"].max() < 1e-14
    rates = states[4980:5004, 5]  # at rest again after a period, by a polynomial of degree 5
    times = np.arange(4980, 5004) * 1e-3 - 4.99
    roots = np.roots(np.polyfit(times, rates, 5))
    period = 4.99 + min(roots[np.isreal(roots)].real, key=abs)
    assert period == pytest.approx(4.991712, abs=1e-6)


GOVERNOR = (
    0.523836,
    0.585079,
    0.658632,
    0.717713,
    0.743249,
    0.727631,
    0.675467,
    0.603181,
    0.536282,
    0.501420,
)
"""Height (m) of the slider of IFToMM benchmark A05 at 0.1, 0.2, ... 1.0 s, in six digits: the
library's reference solution as drawn in the vector graphics of its comparison with OpenSim
(RehabEngGroup/MBSbenchmarksInOpenSim on GitHub, help/images/5MBS_PlotResults.pdf)."""
SLIDER = (
    0.226785384,
    0.263034975,
    0.28194126,
    0.222848664,
    0.184952803,
    0.205149298,
    0.233436939,
    0.272248997,
    0.269894777,
    0.211754668,
)
"""Place (m) of the slider of the library's spatial rigid slider-crank mechanism at 0.1, 0.2, ...
1.0 s, the solution of Gonzalez; FINER: that of Masarati at 0.004 and 0.1 s, from where on it drifts
by its steps. Both as they were submitted to the library (jgerstmayr/EXUDYN on GitHub,
docs/verification/Slidercrank3DiftommBenchmark)."""
FINER = {0.004: 0.2009633, 0.1: 0.2267867}


def test_the_flyball_governor_of_the_library_of_benchmarks():
    found, _ = run(governor(), 4000, 2.5e-4, "passive-midpoint")
    np.testing.assert_allclose(found["x[3]"][400::400], GOVERNOR, rtol=0, atol=1e-6)


def test_the_spatial_slider_crank_of_the_library_of_benchmarks():
    """The solutions of the library differ by more than these bounds from each other, by the steps
    that were taken."""
    found, states = run(slider_crank(), 1000, 1e-3)
    x = found["x[1]"]
    np.testing.assert_allclose(x[100::100], SLIDER, rtol=0, atol=5e-5)
    for time, at in FINER.items():
        assert x[round(time * 1e3)] == pytest.approx(at, abs=1e-6)
    slider, *omega = states[0, 6:10] + [0, 6, 0, 0]
    assert [slider, *omega] == pytest.approx([0.24, 1.92, -0.96, 0.48])
    assert np.ptp(found["energy"]) < 2e-7


@pytest.mark.parametrize(("h", "error"), [(4e-3, 2e-4), (2e-3, 1.3e-5)])
def test_a_heavy_top_keeps_energy_and_both_momenta(h, error):
    """The energy and the angular momenta about the vertical and about its axis are constants of a
    top's motion, through the change of a ball's vector that each half turn brings."""
    linkage = top()
    found, states = run(linkage, round(1.0 / h), h)
    momenta = evaluated(linkage, lambda m: [m.frames["top"].rotation, m.D])
    body = linkage.body[0]
    tensor = body.inertia_tensor + body.mass * (
        np.dot(body.center, body.center) * np.eye(3) - np.outer(body.center, body.center)
    )
    axis = np.array(body.center) / np.linalg.norm(body.center)
    kept = []
    for x in states:
        R, _ = momenta(x[:3], x[3:6])
        # omega by the rate of R, R' (dR/dt) = [omega of the body]
        step = 1e-5
        ends = [momenta(x[:3] + s * step * x[3:6], x[3:6])[0] for s in (1, -1)]
        omega = pin.unSkew(R.T @ (ends[0] - ends[1]) / (2 * step))
        L = R @ tensor @ omega
        kept.append((L[2], L @ R @ axis))
    kept = np.array(kept)
    assert np.ptp(found["energy"]) < error * abs(found["energy"][0])
    for k in (0, 1):
        assert np.ptp(kept[:, k]) < error * np.abs(kept[0, k])
    assert np.abs(states[:, :3]).max() <= 4.0 + 1e-12
    assert (np.abs(np.diff(states[:, :3], axis=0)).max(axis=1) > 2.0).sum() > 5


@pytest.mark.parametrize("axis", [X_AXIS, Y_AXIS, Z_AXIS])
@pytest.mark.parametrize("free", [False, True])
def test_a_passive_method_makes_no_energy_in_space(axis, free):
    """Of a top under gravity along an axis, and of it in flight, where it tumbles about the middle
    one of three moments of inertia, at steps of a tenth of a turn."""
    linkage = top(gravity=tuple(-9.81 * a for a in axis))
    if free:
        thrown = replace(linkage.body[0], inertia=(8e-4, 1.5e-3, 2e-3), center=(0.01, 0.0, 0.02))
        joint = Joint(name="ball", type="floating", child="top")
        spin = tuple(40.0 * a for a in (0.1, 1.0, 0.1))
        rates = {"ball": (0.1, 0.2, 3.0, *spin)}
        linkage = replace(linkage, body=(thrown,), joint=(joint,), start_velocity=rates)
    found, _ = run(linkage, 200, 0.016, "passive-midpoint")
    assert np.diff(found["energy"]).max() < 1e-12
    assert found["stops"].max() == 0


def test_a_loop_that_nothing_can_close_is_refused():
    """A planar four-bar whose cut is 1 mm off the plane, where no coordinate moves it."""
    linkage = bennett()
    flat = {"axis": Z_AXIS, "at_parent": (0.3, 0.0, 0.0)}
    joints = [replace(j, **(flat if i else {"axis": Z_AXIS})) for i, j in enumerate(linkage.joint)]
    cut = Loop(bodies=("rod2", "ground"), at=((0.3, 0.0, 0.001), (0.4, 0.0, 0.0)), name="cut")
    start = {"joint0": 1.2, "joint1": -1.2, "joint2": -1.2}
    planar = replace(linkage, joint=tuple(joints), loop=(cut,), start=start)
    with pytest.raises(AssemblyError) as refused:
        virtual_mechanism(planar, Mechanism())
    said = (
        "loop `cut` (rod2 to ground) can never close: no coordinate moves 3 of its rows, and 0.001"
    )
    assert said in str(refused.value)


FALLING = replace(bennett(), gravity=(0.0, -9.81, 0.0))


def test_an_overconstrained_loop_is_not_locked_by_what_is_redundant():
    """Bennett's loop falls as its energy says, at poses between the closed ones, too, and as its
    one motion in closed form."""
    found, states = run(FALLING, 500, 1e-3)
    exact, floor = tip_of_bennett(0.5)
    assert floor < 1e-11
    tip = [found[f"x[{i}]"][-1] for i in (1, 2, 3)]
    np.testing.assert_allclose(tip, exact, rtol=0, atol=1e-9)
    assert np.ptp(states[:, 0]) > 3.0
    assert np.ptp(found["energy"]) < 1e-8
    assert found["closure_error"].max() < 1e-14


@pytest.mark.parametrize(
    ("peer", "method", "error"),
    [(mujoco_peer, "RK4", 1e-6), (pinocchio_peer, pinocchio_peer.METHODS[0], 1e-9)],
    ids=["mujoco", "pinocchio"],
)
def test_peers_of_the_benchmark_are_given_the_same_linkage(peer, method, error):
    """Bricard's, within the error of their closures."""
    ours = Ours(bricard(), (0.0, 0.0, 0.0), Mechanism(), 1e-3)
    q, qd = np.split(ours.start, 2)
    *wanted, _ = ours.virtual_machine()(200)
    *tip, _ = peer.prepare(ours.linkage, np.zeros(3), q, qd, method, 1e-3)(200)
    assert np.linalg.norm(np.subtract(tip, wanted)) < error
    assert np.linalg.norm(np.subtract(tip, (1.0, -1.0, 0.0))) > 0.05


@pytest.mark.parametrize("linkage", [bricard(), FALLING], ids=["bricard", "bennett"])
def test_a_passive_method_makes_no_energy_in_overconstrained_loops(linkage):
    found, states = run(linkage, 100, 1e-2, "passive-midpoint")
    assert np.diff(found["energy"]).max() < 1e-12
    assert np.ptp(states[:, 0]) > 0.5


def test_a_top_against_its_equations_in_quaternions():
    """R' = R [w], I w' = I w x w + moment, in the body's axes, by a method of order 8 with error
    control: the point on the axis after a second, at 1 ms."""
    linkage = top()
    body, held = linkage.body[0], np.array(linkage.held.at)
    center = np.array(body.center)
    about = body.inertia_tensor + body.mass * (
        center @ center * np.eye(3) - np.outer(center, center)
    )

    def rate(_, y):
        q, w = y[:4], y[4:]
        R = pin.Quaternion(q / np.linalg.norm(q)).toRotationMatrix()
        moment = np.cross(center, body.mass * (R.T @ np.array(linkage.gravity)))
        turned = pin.Quaternion(q) * pin.Quaternion(np.array([*w, 0.0]))
        return [*0.5 * turned.coeffs(), *np.linalg.solve(about, moment - np.cross(w, about @ w))]

    start = [0.0, 0.0, 0.0, 1.0, *linkage.start_velocity["ball"]]
    y = solve_ivp(rate, (0.0, 1.0), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:4, -1]
    wanted = pin.Quaternion(y / np.linalg.norm(y)).toRotationMatrix() @ held
    found, _ = run(linkage, 1000, 1e-3)
    x = [found[f"x[{i}]"][-1] for i in (1, 2, 3)]
    np.testing.assert_allclose(x, wanted, rtol=0, atol=1e-7)


def pose_of_delta(place):
    """Coordinates of a delta at a place of its platform, arms below their pivots, and its inertia
    there, of platform and arms behind rods without mass."""
    angles, inertia = [], DELTA["mass"] * np.eye(3)
    for k in range(3):
        out = np.array([math.cos(2 * math.pi * k / 3), math.sin(2 * math.pi * k / 3), 0.0])
        to = place + (DELTA["platform"] - DELTA["base"]) * out  # from the pivot
        r, low = to @ out, -to[2]
        size = to @ to + DELTA["arm"] ** 2 - DELTA["rod"] ** 2
        # |to - arm (cos out - sin z)| = rod, with the elbow outward
        reach = math.acos(size / (2 * DELTA["arm"] * math.hypot(r, low)))
        angles.append(math.atan2(low, r) - reach)
        arm = np.array([0, 0, -math.sin(angles[-1])]) + math.cos(angles[-1]) * out
        turned = np.array([0, 0, -math.cos(angles[-1])]) - math.sin(angles[-1]) * out
        rod = to - DELTA["arm"] * arm
        rate = rod / (DELTA["arm"] * (rod @ turned))
        inertia += DELTA["inertia"] * np.outer(rate, rate)
    return np.array([*place, *(-angle for angle in angles)]), inertia


def test_inertia_of_a_delta_with_rods():
    """By closures of rods, over its workspace, against the closed form."""
    linkage = delta()
    of = evaluated(linkage, lambda m: [OperationalSpace(m).Lambda_inv, m.h])
    draw = np.random.default_rng(0)
    for _ in range(50):
        place = np.array([*draw.uniform(-0.05, 0.05, 2), draw.uniform(-0.24, -0.17)])
        q, inertia = pose_of_delta(place)
        found, h = of(q, np.zeros(6))
        assert np.abs(h).max() < 1e-15
        np.testing.assert_allclose(np.linalg.inv(found), inertia, rtol=0, atol=1e-12)
    (qdd, _), _ = accelerations(linkage)
    assert qdd.n_instructions() <= 800
