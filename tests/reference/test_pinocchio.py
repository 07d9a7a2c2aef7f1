"""Accelerations, multipliers and mobility of moving linkages against Pinocchio's terms.

Pinocchio gives D, bias forces, closure Jacobians and their rates; NumPy solves
[D -W'; W 0] densely, by least norm where closures are redundant.
"""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.mechanisms import chain, n_four_bar
from benchmarks.peers import pinocchio_peer
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.orchestrator import open_scene
from tests.blocks import running
from tests.mechanisms import evaluated, five_bar, linkages


def ours(linkage, q, qd, F):
    """(qdd, lambda, W' lambda, Lambda^-1, a_bias) by the components."""

    def solution(model, F):
        space = OperationalSpace(model)
        qdd, multipliers = space.motion(model.J_h.T @ F)
        return qdd, multipliers, model.W.T @ multipliers, space.Lambda_inv, space.a_bias

    return [value.squeeze() for value in evaluated(linkage, solution, (3,))(q, qd, F)]


def theirs(linkage, q, qd, F):
    at = pinocchio_peer.Terms(linkage).at(q, qd)
    D, W, J, n, m = at["D"], at["W"], at["J_h"], len(q), len(at["w"])
    K = np.block([[D, -W.T], [W, np.zeros((m, m))]])
    right = np.zeros((n + m, 5))
    right[:n, 0], right[n:, 0] = J.T @ F - at["nle"], -at["w"]
    right[:n, 1], right[n:, 1] = -at["nle"], -at["w"]
    right[:n, 2:] = J.T
    found = np.linalg.lstsq(K, right, rcond=1e-12)[0]
    bias = J @ found[:n, 1] + at["Jdot_qd"]
    return found[:n, 0], found[n:, 0], W.T @ found[n:, 0], J @ found[:n, 2:], bias


def close(a, b, least=1e-3):
    """Within 1e-9 of the quantity's own size, of `least` where it is smaller."""
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * np.abs(b).max(initial=least))


def agree(linkage, q, qd, F, unique=True):
    """All quantities, without lambda where it is not unique."""
    mine, reference = ours(linkage, q, qd, F), theirs(linkage, q, qd, F)
    for k in range(5):
        if unique or k != 1:
            close(mine[k], reference[k])


def open_tree(linkage, q, qd, F):
    """Sizes of (qdd, lambda, W' lambda, Lambda^-1, a_bias) before the closures take their part:
    where these leave nothing, it is nothing against those."""
    at = pinocchio_peer.Terms(linkage).at(q, qd)
    D_inv, J = np.linalg.inv(at["D"]), at["J_h"]
    free, drift = D_inv @ (J.T @ F - at["nle"]), -D_inv @ at["nle"]
    sizes = [free, J.T @ F - at["nle"], J.T @ F - at["nle"], J @ D_inv @ J.T, J @ drift]
    return [np.abs(size).max(initial=1e-3) for size in sizes]


@settings(max_examples=40)
@given(linkages(), st.integers(0, 2**31))
def test_random_linkages_in_motion(drawn, seed):
    linkage, q, qd = drawn
    agree(linkage, q, qd, np.random.default_rng(seed).normal(size=3))


def exact(linkage, q, qd, F):
    """(qdd, lambda, Lambda^-1) of Pinocchio's terms by elimination in rational numbers."""
    at = pinocchio_peer.Terms(linkage).at(q, qd)
    D, W, J, n, m = at["D"], at["W"], at["J_h"], len(q), len(at["w"])
    right = np.zeros((n + m, 4))
    right[:n, 0], right[n:, 0], right[:n, 1:] = J.T @ F - at["nle"], -at["w"], J.T
    K = np.hstack([np.block([[D, -W.T], [W, np.zeros((m, m))]]), right])
    A = np.array([[Fraction(float(v)) for v in row] for row in K])
    for i in range(n + m):
        pivot = i + int(np.argmax(np.abs(A[i:, i])))
        A[[i, pivot]] = A[[pivot, i]]
        A[i] = A[i] / A[i, i]
        others = np.arange(n + m) != i
        A[others] -= np.outer(A[others, i], A[i])
    found = A[:, n + m :].astype(float)
    return found[:n, 0], found[n:, 0], J @ found[:n, 1:]


@settings(max_examples=30)
@given(linkages(max_bodies=6), st.integers(0, 2**31))
def test_masses_of_any_ratio(drawn, seed):
    """Each body's between 1e-4 and 1e4 times what was drawn; sizes are those of the open tree."""
    linkage, q, qd = drawn
    rng = np.random.default_rng(seed)
    factors = 10.0 ** rng.uniform(-4, 4, len(linkage.body))
    bodies = zip(linkage.body, factors, strict=True)
    body = tuple(replace(b, mass=b.mass * f, inertia=b.inertia * f) for b, f in bodies)
    linkage, F = replace(linkage, body=body), rng.normal(size=3)
    qdd, multipliers, _, mobility, _ = ours(linkage, q, qd, F)
    free, efforts, _, open_mobility, _ = open_tree(linkage, q, qd, F)
    mine, sizes = (qdd, multipliers, mobility), (free, efforts, open_mobility)
    for a, b, size in zip(mine, exact(linkage, q, qd, F), sizes, strict=True):
        close(a, b, least=size)


@pytest.mark.parametrize("linkage", [five_bar(), chain(12)], ids=["five-bar", "chain of 12"])
def test_known_linkages_in_motion(linkage):
    start = running(linkage).state["q"]
    qd = np.random.default_rng(2).uniform(-3, 3, len(start))
    agree(linkage, start, qd, np.array([-0.5, 0.3, -0.0025]))


@pytest.mark.parametrize("N", [2, 10])
def test_n_four_bar_away_from_its_singular_poses(N):
    """On its parallelogram branch; W' lambda rather than lambda, of which 1/sigma is left."""
    q = np.array([1.0] * (N + 1) + [-1.0] * N)
    agree(n_four_bar(N), q, -2.0 * q, np.array([1.0, -2.0, 0.3]))


def test_redundant_closures_carry_the_same_force():
    """Every loop twice: lambda is not unique, W' lambda and the motion are."""
    linkage, q = five_bar(), running(five_bar()).state["q"]
    qd, F = np.array([1.0, -2.0, 0.5, 3.0]), np.array([-0.5, 0.3, -0.0025])
    agree(replace(linkage, loop=linkage.loop * 2), q, qd, F, unique=False)


SHIPPED = (
    *("pendulum", "four-bar", "parallelogram", "slider-crank", "five-bar", "six-bar"),
    *("remote-centre", "serial", "closed-loop-b1", "obstacles", "two-hands"),
)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_linkages_in_motion(name):
    """Bodies, joints, loops and gravity of the scene from its assembled start, at random rates;
    springs, friction and drives, which the other code's model does not have, taken out.

    Where closures repeat each other W' lambda is compared, as lambda is not unique.
    """
    shipped = open_scene.load(name).linkage
    passive = {"stiffness": None, "damping": None, "friction": None, "drive": None, "rest": None}
    joints = tuple(replace(j, **passive) for j in shipped.joint)
    linkage = replace(shipped, joint=joints, spring=(), point=())
    q, rng = running(linkage).state["q"], np.random.default_rng(11)
    qd, F = rng.uniform(-2, 2, len(q)), rng.normal(size=3)
    at = pinocchio_peer.Terms(linkage).at(q, qd)
    rank = np.linalg.matrix_rank(at["W"], 1e-9) if linkage.loop else 0
    # Rates that the closures allow: a redundant pair of them cannot be met otherwise.
    if linkage.loop:
        qd = qd - np.linalg.pinv(at["W"], rcond=1e-9) @ (at["W"] @ qd)
    agree(linkage, q, qd, F, unique=rank == 2 * len(linkage.loop))
