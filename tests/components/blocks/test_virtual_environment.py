"""The graphics copy: mobility, directions, synchronisation and branch."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.components.dynamics.constrained_directions import ConstrainedDirections
from hapticlink.components.dynamics.gradients import of_projector
from hapticlink.components.dynamics.rendered_directions import WHOLE
from hapticlink.components.specs.linkage import (
    Directions,
    FurtherPoint,
    GraphicsCopy,
    Joint,
    Linkage,
    Loop,
    OperationalPoint,
)
from studies.report import appendix_a
from studies.report.appendix_a import L
from tests.blocks import Running, running, virtual_environment
from tests.mechanisms import WRENCH, five_bar, rod


def environment(**settings):
    return virtual_environment(five_bar(), GraphicsCopy(**settings), Directions())


def test_mobility_and_projector_at_the_start():
    y = Running(environment()).y
    J_h = appendix_a.J_h(y["q"])
    Lambda_inv = J_h @ appendix_a.joint_mobility(y["q"]) @ J_h.T
    np.testing.assert_allclose(y["Lambda_inv"], Lambda_inv, atol=1e-12 * 522)
    S = np.diag([1, 1, np.mean(L)])
    U, values, _ = np.linalg.svd(S @ Lambda_inv @ S)  # (B.14), by LAPACK
    constrained = U[:, values / values[0] < 0.1]
    np.testing.assert_allclose(y["P_c"], constrained @ constrained.T, atol=1e-10)
    assert y["n_constraints"] == constrained.shape[1] == 1
    np.testing.assert_allclose(y["P_c"] @ S @ y["Lambda_inv"] @ S @ y["P_c"], 0, atol=1e-10)


@pytest.mark.parametrize("rate", [10, 30, 60])
@pytest.mark.parametrize("substeps", [1, 20])
def test_report_gains_are_stable_at_any_graphics_rate(rate, substeps):
    """Displaced by 5 mm and 0.2 rad, the copy settles on a reference at rest."""
    component = environment(sync="operational", substeps=substeps)
    block = Running(component)
    elsewhere = block.y["q"] + np.array([0.1, 0.1, 0.0, 0.0])
    target = Running(component, parameters={"q_start": elsewhere}).y
    block.set(x_ref=target["x"], q_ref=target["q"])
    for _ in range(rate * 14):
        block.step(1 / rate)
        assert np.abs(block.x).max() < 100
    np.testing.assert_allclose(block.y["x"], target["x"], atol=1e-5)
    np.testing.assert_allclose(block.y["v"], 0, atol=1e-5)


def followed(copy, rate):
    """(mechanism, its outputs when the frame began) after each frame of 3 s in which the copy
    follows the mechanism alone, which is then at the end of the frame."""
    leader = running(five_bar()).set(F_hand=WRENCH)
    for k in range(1, 3 * rate + 1):
        began = leader.y
        signals = {f"{name}_ref": began[name] for name in ("x", "v", "q", "qd")}
        copy.set(**{v.name: signals[v.name] for v in copy.component.inputs})
        copy.step(1 / rate)
        while leader.t < k / rate - 1e-9:
            leader.step(1 / 512)
        yield leader, began


def frames(sync, rate):
    """(branch_ok, q_error) at the end of each frame."""
    copy, seen = Running(environment(sync=sync)), []
    for leader, _ in followed(copy, rate):
        copy.set(q_ref=leader.state["q"])
        seen.append((copy.y["branch_ok"], copy.y["q_error"]))
    return np.array(seen)


def longest_fold(seen):
    """Largest number of consecutive frames off the leader's branch."""
    longest = run = 0
    for ok in seen[:, 0]:
        run = 0 if ok else run + 1
        longest = max(longest, run)
    return longest


def test_joint_synchronisation_stays_on_the_branch_where_the_pose_alone_folds():
    """By pose alone the hand cannot see links 3 and 4 fold."""
    pose, joint = frames("operational", 30), frames("joint", 30)
    assert longest_fold(pose) >= 5
    assert longest_fold(joint) <= 1  # a frame's lag where the leader itself passes
    assert joint[:, 1].max() < 1.0 < pose[:, 1].max()


@pytest.mark.parametrize("rate", [10, 30, 60])
def test_exact_synchronisation_is_where_the_mechanism_was_when_the_frame_began(rate):
    copy = Running(environment())
    for _, began in followed(copy, rate):
        np.testing.assert_allclose(copy.y["q"], began["q"], atol=1e-12)
        np.testing.assert_allclose(copy.y["v"], began["v"], atol=1e-11 * np.abs(began["v"]).max())
        assert copy.y["branch_ok"] == 1


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_exact_synchronisation_closes_what_its_reference_leaves_open(seed):
    """Off by up to a milliradian, more than Baumgarte stabilisation leaves."""
    rng = np.random.default_rng(seed)
    copy = Running(environment())
    q = copy.y["q"] + rng.uniform(-1e-3, 1e-3, 4)
    qd = rng.uniform(-5, 5, 4)
    copy.set(q_ref=q, qd_ref=qd)
    copy.step(1 / 30)
    np.testing.assert_allclose(appendix_a.h(copy.y["q"]), 0, atol=1e-12)
    np.testing.assert_allclose(copy.y["q"], q, atol=0.01)
    closed = copy.x[4:8]
    np.testing.assert_allclose(appendix_a.W(copy.y["q"]) @ closed, 0, atol=1e-6)
    assert copy.y["branch_ok"] == 1


def test_a_folded_copy_is_reported():
    block = Running(environment(sync="operational"))
    q = block.y["q"]
    block.set(q_ref=q)
    assert block.y["branch_ok"] == 1
    assert block.y["q_error"] == 0
    # The mirror image of links 3 and 4 about the line from ground to the tip.
    tip = L[2] * np.exp(1j * q[2]) + L[3] * np.exp(1j * (q[2] + q[3]))
    folded = np.array([q[0], q[1], 2 * np.angle(tip) - q[2], -q[3]])
    np.testing.assert_allclose(appendix_a.h(folded), 0, atol=1e-12)
    block.set(q_ref=folded)
    assert block.y["branch_ok"] == 0


@pytest.mark.parametrize("users", [(), ("left",)])
@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_gradients_are_those_of_the_matrices_at_the_predicted_coordinates(users, seed):
    """Against central differences; also where the projector's rank is 2."""
    linkage = five_bar()
    if users:
        left = FurtherPoint(name="left", body="link4", at=(0.02, 0.0))
        linkage = replace(linkage, point=(left,))
    copy = virtual_environment(linkage, GraphicsCopy(), Directions(), users=users, predicted=True)
    copy = Running(copy)
    rng = np.random.default_rng(seed)
    turned = copy.y["q_predicted"] + rng.uniform(-1, 1, 4)
    matrices = [f"{prefix}{name}" for prefix in ("", *(f"{u}." for u in users))
                for name in ("Lambda_inv", "P_c")]  # fmt: skip

    def at(q):
        return copy.put(q_predicted=q).outputs(*matrices)

    copy.put(n_constrained=float(rng.integers(1, 3)))
    gradients = {name: copy.put(q_predicted=turned).y[f"{name}_gradient"] for name in matrices}
    for k, e in enumerate(1e-5 * np.eye(4)):
        ahead, behind = at(turned + e), at(turned - e)
        for name in matrices:
            slope = (ahead[name] - behind[name]).ravel() / 2e-5
            size = np.abs(gradients[name]).max()
            np.testing.assert_allclose(gradients[name][:, k], slope, atol=1e-5 * size, err_msg=name)


@settings(max_examples=10, deadline=None)
@given(st.floats(0.2, 1.4), st.floats(0.1, 0.4))
def test_gradients_hold_along_redundant_closures(turned, ratio):
    """Of a platform on three rockers, which stay parallel; the third is redundant."""
    rockers = [rod(name, 0.2, 0.3) for name in ("left", "middle", "right")]
    at = {"left": 0.0, "middle": 0.3 * ratio, "right": 0.3}
    joints = [Joint(name=name, child=name, at_parent=(x, 0.0)) for name, x in at.items()]
    linkage = Linkage(
        body=(*rockers, rod("platform", 0.3)),
        joint=(*joints, Joint(name="hinge", parent="left", child="platform", at_parent=(0.2, 0.0))),
        loop=tuple(
            Loop(bodies=("platform", name), at=((at[name], 0.0), (0.2, 0.0)))
            for name in ("middle", "right")
        ),
        operational_point=OperationalPoint(body="platform", at=(0.1, 0.02)),
        start={"left": 0.5, "middle": 0.5, "right": 0.5, "hinge": -0.5},
    )
    copy = Running(virtual_environment(linkage, GraphicsCopy(), Directions(), predicted=True))
    along = np.array([1.0, 1.0, 1.0, -1.0])

    def at_angle(angle):
        return copy.put(q_predicted=angle * along).y

    here, ahead, behind = (at_angle(turned + e) for e in (0.0, 1e-5, -1e-5))
    for name in ("Lambda_inv", "P_c"):
        slope = (ahead[name] - behind[name]).ravel() / 2e-5
        found = here[f"{name}_gradient"] @ along
        np.testing.assert_allclose(found, slope, atol=1e-6 * np.abs(here[name]).max(), err_msg=name)


def test_between_equal_eigenvalues_the_projector_has_no_gradient():
    values, slope = ca.DM([1, 1, 3]), ca.DM(np.ones((9, 1)))
    eye = ca.SX.eye(3)
    found = ConstrainedDirections(*[ca.SX()] * 2, {}, WHOLE, eye, ca.SX(values), eye, ca.SX(1))
    gradient = ca.evalf(of_projector(found, ca.SX(slope))).full().reshape(3, 3)
    np.testing.assert_array_equal(gradient, [[0, 0, -0.5], [0, 0, 0], [-0.5, 0, 0]])


def test_matrices_are_computed_in_the_middle_of_the_frame_in_which_they_are_used():
    linkage, h = five_bar(), 1 / 20
    copy = Running(virtual_environment(linkage, GraphicsCopy(), Directions(), predicted=True))
    plain = Running(virtual_environment(linkage, GraphicsCopy(), Directions()))
    leader = running(linkage).set(F_hand=WRENCH)
    for _ in range(100):
        leader.step(1 / 512)
    for block in (copy, plain):
        block.set(q_ref=leader.y["q"], qd_ref=leader.y["qd"]).step(h)
    predicted = leader.y["q"] + 1.5 * h * leader.y["qd"]
    np.testing.assert_allclose(copy.y["q_predicted"], predicted, atol=1e-9)
    np.testing.assert_array_equal(copy.y["q"], plain.y["q"])
    elsewhere = plain.put(q=predicted)
    np.testing.assert_allclose(
        copy.y["Lambda_inv"], elsewhere.y["Lambda_inv"], rtol=1e-9, atol=1e-9
    )
