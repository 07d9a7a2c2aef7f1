"""The graphics copy: mobility, directions, synchronisation and branch."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.components.specs.linkage import Directions, GraphicsCopy, Mechanism
from tests.blocks import Running, virtual_environment, virtual_mechanism
from tests.components import appendix_a
from tests.mechanisms import TABLE_6_1, WRENCH, five_bar

L = np.mean(TABLE_6_1["l"])


def environment(**settings):
    return virtual_environment(five_bar(), GraphicsCopy(**settings), Directions())


def mobility(q):
    m, l, J, f = TABLE_6_1["m"], TABLE_6_1["l"], TABLE_6_1["I"], (0.5,) * 4  # noqa: E741
    D, W, J_h = appendix_a.D(q, m, l, J, f), appendix_a.W(q, l), appendix_a.J_h(q, l, f)
    A, B = np.linalg.solve(D, J_h.T), np.linalg.solve(D, W.T)
    return J_h @ (A - B @ np.linalg.solve(W @ B, W @ A))


def test_mobility_and_projector_at_the_start():
    y = Running(environment()).y
    Lambda_inv = mobility(y["q"])
    np.testing.assert_allclose(y["Lambda_inv"], Lambda_inv, atol=1e-12 * 522)
    S = np.diag([1, 1, L])
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


def frames(sync, rate):
    """(branch_ok, q_error) frame by frame, following the mechanism alone for 3 s."""
    leader = Running(virtual_mechanism(five_bar(), Mechanism(), step_s=1 / 512))
    leader.set(F_hand=WRENCH)
    copy, seen = Running(environment(sync=sync)), []
    for k in range(1, 3 * rate + 1):
        y = leader.y
        signals = {"x_ref": y["x"], "v_ref": y["v"], "q_ref": y["q"], "qd_ref": y["qd"]}
        copy.set(**{v.name: signals[v.name] for v in copy.component.inputs})
        copy.step(1 / rate)
        while leader.t < k / rate - 1e-9:
            leader.step(1 / 512)
        copy.set(q_ref=leader.y["q"])
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
    leader = Running(virtual_mechanism(five_bar(), Mechanism(), step_s=1 / 512))
    leader.set(F_hand=WRENCH)
    copy = Running(environment())
    for k in range(1, 3 * rate + 1):
        began = leader.y
        copy.set(q_ref=began["q"], qd_ref=began["qd"])
        copy.step(1 / rate)
        np.testing.assert_allclose(copy.y["q"], began["q"], atol=1e-12)
        np.testing.assert_allclose(copy.y["v"], began["v"], atol=1e-11 * np.abs(began["v"]).max())
        assert copy.y["branch_ok"] == 1
        while leader.t < k / rate - 1e-9:
            leader.step(1 / 512)


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
    l = TABLE_6_1["l"]  # noqa: E741
    np.testing.assert_allclose(appendix_a.h(copy.y["q"], l), 0, atol=1e-12)
    np.testing.assert_allclose(copy.y["q"], q, atol=0.01)
    closed = copy.x[4:8]
    np.testing.assert_allclose(appendix_a.W(copy.y["q"], l) @ closed, 0, atol=1e-6)
    assert copy.y["branch_ok"] == 1


def test_folded_copy_is_told():
    component = environment(sync="operational")
    block = Running(component)
    q = block.y["q"]
    block.set(q_ref=q)
    assert block.y["branch_ok"] == 1
    assert block.y["q_error"] == 0
    # The mirror image of links 3 and 4 about the line from ground to the tip.
    tip = np.array([*TABLE_6_1["l"][2:]])
    x, y = (
        tip[0] * np.cos(q[2]) + tip[1] * np.cos(q[2] + q[3]),
        tip[0] * np.sin(q[2]) + tip[1] * np.sin(q[2] + q[3]),
    )
    across = 2 * np.arctan2(y, x)
    folded = np.array([q[0], q[1], across - q[2], -q[3]])
    np.testing.assert_allclose(appendix_a.h(folded, TABLE_6_1["l"]), 0, atol=1e-12)
    block.set(q_ref=folded)
    assert block.y["branch_ok"] == 0
