"""Options of the mechanism: further hands, rank of the closures, the local model."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.components.dynamics import closure_diagnostics
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.specs.linkage import Directions, FurtherPoint, GraphicsCopy
from hapticlink.orchestrator import open_scene
from studies.report import appendix_a
from studies.report.appendix_a import L
from tests.blocks import Running, running, virtual_environment
from tests.mechanisms import WRENCH, evaluated, five_bar, linkages


def two_handed(at=(0.03, 0.0)):
    point = FurtherPoint(name="left", body="link4", at=at)
    return dataclasses.replace(five_bar(), point=(point,))


def left(q, at=0.03):
    """Pose of the point of link 4."""
    theta = q[2] + q[3]
    return np.array(
        [
            L[2] * math.cos(q[2]) + at * math.cos(theta),
            L[2] * math.sin(q[2]) + at * math.sin(theta),
            theta,
        ]
    )


def test_two_hands_on_one_mechanism():
    """Accelerations and mobilities against Appendix A with both Jacobians."""
    block = running(two_handed(), directions=Directions())
    q = block.state["q"]
    qd = np.linalg.svd(appendix_a.W(q))[2][2:].T @ (2.0, -1.0)  # which the closures allow
    block.put(qd=qd)
    second = (0.2, -0.4, 0.001)
    block.set(**{"F_hand": WRENCH, "left.F_hand": second})
    J_left = np.array([(left(q + 1e-6 * d) - left(q - 1e-6 * d)) / 2e-6 for d in np.eye(4)]).T
    kept, J_h = appendix_a.joint_mobility(q), appendix_a.J_h(q)
    free, _ = appendix_a.acceleration(q, qd, WRENCH)
    y = block.y
    np.testing.assert_allclose(y["qdd"], free + kept @ J_left.T @ second, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(y["left.x"], left(q), rtol=1e-14)
    np.testing.assert_allclose(y["left.v"], J_left @ qd, atol=1e-8)
    for name, of in (("Lambda_inv", J_h), ("left.Lambda_inv", J_left)):
        np.testing.assert_allclose(y[name], of @ kept @ of.T, atol=1e-7 * np.abs(y[name]).max())


RANKS = {"five-bar": 2, "parallelogram": 3, "six-bar": 4, "remote-centre": 4, "n-four-bar": 4}


@pytest.mark.parametrize(("name", "rank"), RANKS.items())
def test_rank_of_shipped_linkages(name, rank):
    """Coordinates minus degrees of freedom: 2, 1, 1, 2 and 1 of them."""
    linkage = open_scene.load(name).linkage
    block = running(linkage, diagnostics=True)
    values = eigenvalues(*closures(linkage, block.state["q"])[2:])
    assert block.y["rank"] == rank
    assert block.y["condition"] == pytest.approx(values[0] / values[rank - 1], rel=0.02)


def test_rank_drops_where_the_rods_line_up():
    linkage = open_scene.load("n-four-bar", ["linkage.n=1"]).linkage
    block = running(linkage, diagnostics=True)
    assert block.y["rank"] == 2
    block.put(q=(0.0, 0.0, 0.0))
    assert block.y["rank"] == 1


@settings(max_examples=30)
@given(linkages(), st.integers(1, 2))
def test_rank_and_condition_against_singular_values(drawn, times):
    """Every loop once, or twice: redundant closures."""
    linkage, q, _ = drawn
    if not linkage.loop:
        return
    rank = 2 * len(linkage.loop)
    linkage = dataclasses.replace(linkage, loop=linkage.loop * times)
    found, condition, W, D = closures(linkage, q)
    values = eigenvalues(W, D)
    assert found == np.sum(values > 1e-9 * values[0]) == rank
    # Eigenvalues next to the largest or to the least hide some of it.
    assert 0.7 < condition * values[rank - 1] / values[0] < 1 + 1e-6


def test_condition_near_a_singular_pose():
    """40 windows at .05 rad, 80 closures: 6.1e5."""
    linkage = open_scene.load("n-four-bar", ["linkage.n=40"]).linkage
    rank, condition, W, D = closures(linkage, [0.05] * 41 + [-0.05] * 40)
    values = eigenvalues(W, D)
    assert rank == 80
    assert condition == pytest.approx(values[0] / values[-1], rel=0.02)


def eigenvalues(W, D):
    """Of W D^-1 W', largest first."""
    return np.linalg.svd(W @ np.linalg.inv(np.linalg.cholesky(D)).T, compute_uv=False) ** 2


def closures(linkage, q):
    """(rank, condition, W, D) at q."""

    def diagnosed(model):
        values = closure_diagnostics.values(OperationalSpace(model).solver)
        return values["rank"], values["condition"], model.W, model.D

    return evaluated(linkage, diagnosed)(q, np.zeros(len(q)))


LOCAL_MODEL = ("D", "W", "w", "J_h")


def coupled(**settings):
    """(copy, mechanism) of the five-bar, the mechanism on the copy's matrices."""
    copy = virtual_environment(
        five_bar(), GraphicsCopy(sync="joint"), Directions(), local_model=True
    )
    settings |= {"step_s": 1 / 512, "frame_s": 1 / 64, "stabilization": "baumgarte"}
    return Running(copy), running(five_bar(), **settings)


def test_the_local_model_holds_the_matrices_of_appendix_a():
    copy, held = coupled()
    q = copy.state["q"]
    y = copy.y
    np.testing.assert_allclose(y["D"], appendix_a.D(q), rtol=1e-13)
    np.testing.assert_allclose(y["W"], appendix_a.W(q), atol=1e-16)
    np.testing.assert_allclose(y["J_h"], appendix_a.J_h(q), atol=1e-16)
    starts = {v.name: np.reshape(v.starts, v.shape) for v in held.component.inputs}
    for name in LOCAL_MODEL:
        np.testing.assert_allclose(starts[name], y[name], rtol=1e-13, atol=1e-15)


def test_fresh_matrices_and_no_velocity_give_the_mechanisms_own_acceleration():
    copy, held = coupled()
    own = running(five_bar())
    for block in (held, own):
        block.set(F_hand=WRENCH)
    held.set(**{name: copy.y[name] for name in LOCAL_MODEL})
    for name in ("qdd", "lambda"):
        np.testing.assert_allclose(held.y[name], own.y[name], rtol=1e-11)


def test_matrices_held_over_a_frame_keep_the_loop_closed_to_a_millimetre():
    """60 Hz frames of 0.25 s; the closures themselves are fresh at every tick."""
    copy, held = coupled(integrator="semi-implicit-euler")
    own = running(five_bar())
    for block in (held, own):
        block.set(F_hand=WRENCH)
    for k in range(128):
        if k % 8 == 0:
            copy.set(q_ref=held.state["q"], qd_ref=held.state["qd"])
            copy.step(1 / 64)
            held.set(**{name: copy.y[name] for name in LOCAL_MODEL})
        held.step(1 / 512)
        own.step(1 / 512)
        assert held.y["closure_error"] < 1e-3
    error = np.linalg.norm(held.y["x"][:2] - own.y["x"][:2])
    assert 1e-6 < error < 5e-3  # it is an approximation, and a near one
