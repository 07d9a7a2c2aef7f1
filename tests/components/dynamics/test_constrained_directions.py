"""Eigenvalues with bounded work; number and projector of the constrained directions."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.components.dynamics import constrained_directions
from hapticlink.components.specs.linkage import (
    Body,
    Directions,
    GraphicsCopy,
    Joint,
    Linkage,
    Loop,
    OperationalPoint,
)
from tests.blocks import Running, running, virtual_environment

A = ca.SX.sym("A", 3, 3)
EIGEN = ca.Function("eigen", [A], list(constrained_directions.eigen(A)))
VALUES, N, TOLERANCE, HYSTERESIS = (
    ca.SX.sym(s, k) for s, k in zip("vnth", (3, 1, 1, 1), strict=True)
)
COUNT = ca.Function(
    "count",
    [VALUES, N, TOLERANCE, HYSTERESIS],
    [constrained_directions.count(VALUES, N, TOLERANCE, HYSTERESIS)],
)
PROJECTOR = ca.Function(
    "P", [A, N], [constrained_directions.projector(*constrained_directions.eigen(A), N)]
)

# Below 1e-150 squares underflow; no mobility is that small.
entry = st.floats(-1e3, 1e3).map(lambda v: v if abs(v) > 1e-100 else 0.0)
entries = st.lists(entry, min_size=6, max_size=6)


def symmetric(v):
    return np.array([[v[0], v[1], v[2]], [v[1], v[3], v[4]], [v[2], v[4], v[5]]])


@settings(max_examples=200)
@given(entries)
def test_eigenvalues_are_those_of_lapack(v):
    M = symmetric(v)
    values, vectors = (np.array(o) for o in EIGEN(M))
    scale = np.abs(M).max() + 1e-300
    np.testing.assert_allclose(np.sort(values.ravel()), np.linalg.eigvalsh(M), atol=1e-13 * scale)
    np.testing.assert_allclose(vectors @ np.diag(values.ravel()) @ vectors.T, M, atol=1e-13 * scale)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(3), atol=1e-14)


@settings(max_examples=100)
@given(entries, st.integers(0, 3))
def test_projector_is_orthogonal_of_that_rank(v, number):
    P = np.array(PROJECTOR(symmetric(v), number))
    np.testing.assert_allclose(P @ P, P, atol=1e-13)
    np.testing.assert_allclose(P, P.T, atol=1e-13)
    assert np.trace(P) == pytest.approx(number, abs=1e-13)


def test_null_directions_are_columns_of_U_and_not_its_rows():
    """(B.14): the report prints rows; the null columns span what the projector keeps."""
    rng = np.random.default_rng(0)
    B = rng.normal(size=(3, 2))
    U, _, _ = np.linalg.svd(B @ B.T)
    P = np.array(PROJECTOR(B @ B.T, 1))
    np.testing.assert_allclose(P, np.outer(U[:, 2], U[:, 2]), atol=1e-12)
    assert np.abs(P - np.outer(U[2], U[2])).max() > 0.1


def test_count_has_hysteresis():
    ratios = lambda r: [0.0, r, 1.0]  # noqa: E731
    assert COUNT(ratios(0.12), 1, 0.1, 1.5) == 1
    assert COUNT(ratios(0.09), 1, 0.1, 1.5) == 2
    assert COUNT(ratios(0.12), 2, 0.1, 1.5) == 2
    assert COUNT(ratios(0.16), 2, 0.1, 1.5) == 1
    assert COUNT([1.0, 0.0, 0.09], 1, 0.1, 1.5) == 2  # order of the entries does not matter


@pytest.mark.parametrize("mass", [1e-4, 1.0, 1e4])
def test_a_truss_resists_in_all_three_directions(mass):
    """Two bars pinned to the ground and to each other: no freedom, Lambda^-1 is rounding."""
    bars = tuple(Body(name=name, mass=mass, inertia=0.01 * mass) for name in "ab")
    truss = Linkage(
        body=bars,
        joint=(Joint(name="ja", child="a"), Joint(name="jb", child="b", at_parent=(1.0, 0.0))),
        loop=(Loop(bodies=("a", "b"), at=((0.7, 0.0), (0.7, 0.0))),),
        operational_point=OperationalPoint(body="a", at=(0.7, 0.0)),
        start={"ja": 0.775, "jb": 2.36},
    )
    copy = virtual_environment(truss, GraphicsCopy(sync="operational"), Directions())
    for block in (running(truss, directions=Directions()), Running(copy)):
        for _ in range(3):
            assert block.y["n_constraints"] == 3
            np.testing.assert_allclose(block.y["P_c"], np.eye(3), atol=1e-14)
            block.step(1 / 512)
