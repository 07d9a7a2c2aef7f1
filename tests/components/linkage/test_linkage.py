"""Linkage terms against the report's Appendix A and against the laws they must obey."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from hapticlink.components.dynamics.articulated_body import TreeInertia
from hapticlink.components.linkage.parameters import mean_link_length
from hapticlink.components.linkage.poses import poses
from hapticlink.components.specs.linkage import Body, Joint, Linkage, OperationalPoint
from studies.report import appendix_a
from tests.mechanisms import evaluated, five_bar, linkages, one_body, terms

F_CM = (0.3, 0.6, 0.45, 0.7)


@pytest.mark.parametrize("seed", range(5))
def test_terms_meet_appendix_a(seed):
    rng = np.random.default_rng(seed)
    q, qd = rng.uniform(-3, 3, 4), rng.uniform(-5, 5, 4)
    D, C_qd, W, w, h, x_h, J_h = terms(five_bar(f=F_CM), "D", "C_qd", "W", "w", "h", "x_h", "J_h")(
        q, qd
    )
    tight = {"rtol": 1e-13, "atol": 1e-15}
    np.testing.assert_allclose(D, appendix_a.D(q, f=F_CM), **tight)
    C = appendix_a.C(q, qd, f=F_CM)
    np.testing.assert_allclose(C_qd.ravel(), C @ qd, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(W, appendix_a.W(q), **tight)
    np.testing.assert_allclose(w.ravel(), appendix_a.w(q, qd), rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(h.ravel(), appendix_a.h(q), **tight)
    np.testing.assert_allclose(x_h.ravel(), appendix_a.r_h(q, f=F_CM), **tight)
    np.testing.assert_allclose(J_h, appendix_a.J_h(q, f=F_CM), **tight)


def test_random_linkages_have_loops_of_every_number():
    seen = Counter()

    @given(linkages())
    def draw(drawn):
        linkage, _, _ = drawn
        seen[len(linkage.loop), any(j.type == "prismatic" for j in linkage.joint)] += 1

    draw()
    for loops in range(4):
        assert seen[loops, False] + seen[loops, True] >= 5
        assert seen[loops, True] >= 2


@settings(max_examples=30)
@given(linkages())
def test_laws_of_any_linkage(drawn):
    """D is symmetric positive definite, T = 1/2 qd' D qd, C qd = Ddot qd - dT/dq; loops are closed
    and regular."""
    linkage, q, qd = drawn
    at = terms(linkage, "D", "C_qd", "kinetic_energy", "h", "W")
    D, C_qd, T, h, W = at(q, qd)
    np.testing.assert_allclose(D, D.T, atol=1e-14)
    assert np.linalg.eigvalsh(D).min() > 0
    np.testing.assert_allclose(T.item(), 0.5 * qd @ D @ qd, rtol=1e-12)
    step = 1e-6
    Ddot = (at(q + step * qd, qd)[0] - at(q - step * qd, qd)[0]) / (2 * step)
    shifts = step * np.eye(len(q))
    dT = np.array([at(q + e, qd)[2] - at(q - e, qd)[2] for e in shifts]).ravel() / (2 * step)
    size = 1 + np.abs(Ddot).max()
    np.testing.assert_allclose(C_qd.ravel(), Ddot @ qd - dT, atol=1e-7 * size)
    assert np.abs(h).max(initial=0) < 1e-14
    if linkage.loop:
        assert np.linalg.cond(W @ np.linalg.solve(D, W.T)) < 1e6


def test_free_body_is_its_own_inertia():
    body = Body(name="b", mass=2.0, inertia=0.1, center=(0.3, -0.2))
    linkage = one_body(body, at=body.center, type="free")
    q, qd = np.array([0.1, -0.2, 0.7]), np.array([1.0, 2.0, 3.0])
    D, J_h, T = terms(linkage, "D", "J_h", "kinetic_energy")(q, qd)
    v = J_h @ qd
    np.testing.assert_allclose(J_h.T @ np.diag([2.0, 2.0, 0.1]) @ J_h, D, atol=1e-15)
    np.testing.assert_allclose(T.item(), 0.5 * (2 * v[0] ** 2 + 2 * v[1] ** 2 + 0.1 * v[2] ** 2))


def test_mean_link_length_of_the_five_bar():
    assert mean_link_length(five_bar()) == pytest.approx(np.mean(appendix_a.L), rel=1e-15)


@settings(max_examples=30)
@given(linkages())
def test_tree_recursion_is_D_and_its_inverse(drawn):
    """D a and D^-1 b by the articulated-body recursion against the matrix, free joints too."""
    linkage, q, qd = drawn
    free = Joint(name="float", type="free", child="extra", parent=linkage.body[-1].name)
    body = Body(name="extra", mass=0.7, inertia=0.02, center=(0.1, -0.2))
    linkage = replace(linkage, body=(*linkage.body, body), joint=(*linkage.joint, free))
    q, qd = np.r_[q, 0.2, -0.1, 0.5], np.r_[qd, 1, 2, 3]

    def both(model, right):
        tree = TreeInertia(model)
        return model.D, tree.apply(right), tree.solve(right)

    b = np.random.default_rng(0).normal(size=(len(q), 2))
    D, applied, solved = evaluated(linkage, both, b.shape)(q, qd, b)
    np.testing.assert_allclose(applied, D @ b, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(solved, np.linalg.solve(D, b), rtol=1e-8, atol=1e-8)


def test_places_of_two_links_and_a_slider():
    """A link about the origin, a second one on its end, and a slider along an axis of the second:
    sums of rotated vectors."""
    slide = {"type": "prismatic", "at_parent": (0.4, 0.0), "axis": 0.5}
    linkage = Linkage(
        body=tuple(Body(name=n, mass=1.0, inertia=0.1) for n in "abc"),
        joint=(
            Joint(name="first", child="a"),
            Joint(name="second", parent="a", child="b", at_parent=(0.3, 0.1), at_child=(-0.2, 0.0)),
            Joint(name="slide", parent="b", child="c", **slide),
        ),
        operational_point=OperationalPoint(body="c"),
    )
    first, second, slid = q = np.array([[0.7, 2.5], [-1.9, 0.4], [0.25, -0.1]])
    turned = np.exp(1j * (first + second))
    b = (0.3 + 0.1j) * np.exp(1j * first) + 0.2 * turned
    c = b + (0.4 + slid * np.exp(0.5j)) * turned
    expected = {"a": (0 * b, first), "b": (b, first + second), "c": (c, first + second)}
    places = poses(linkage, q.T)
    for body, (place, angle) in expected.items():
        exact = np.column_stack([place.real, place.imag, angle])
        np.testing.assert_allclose(places[body], exact, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(places["ground"], np.zeros((2, 3)))
