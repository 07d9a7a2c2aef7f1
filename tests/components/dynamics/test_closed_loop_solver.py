"""The closed-loop-ideal solve where W is regular, redundant and singular."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticlink.components.dynamics.closed_loop_solver import ClosedLoopSolver


class DenseInertia:
    """D as a matrix, D^-1 = L^-T L^-1 by Cholesky."""

    def __init__(self, D):
        self.n, self.d, self.k = D.shape[0], ca.SX.ones(D.shape[0]), ca.SX(D.shape[0], 1)
        self.L_inv = ca.inv(ca.chol(D).T)

    def inward(self, b):
        return self.L_inv @ b

    def outward(self, u):
        return self.L_inv.T @ u


def pairs(m):
    """The rows of loops by revolute cuts, the last one alone where m is odd."""
    return [2] * (m // 2) + [1] * (m % 2)


def solve(D, W, b, c):
    symbols = [ca.SX.sym("D", *D.shape), ca.SX.sym("W", *W.shape)]
    symbols += [ca.SX.sym("b", len(b)), ca.SX.sym("c", len(c))]
    solver = ClosedLoopSolver(DenseInertia(symbols[0]), symbols[1], pairs(W.shape[0]))
    out = solver.solve(*symbols[2:])
    f = ca.Function("solve", symbols, list(out))
    return [np.array(v).ravel() for v in f(D, W, b, c)]


def problem(seed, n, m, rank):
    """A random D and a W of the given rank, with a right-hand side that can be met."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    D = A @ A.T + 0.1 * np.eye(n)
    W = rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n))
    return D, W, rng.normal(size=n), W @ rng.normal(size=n)


@given(st.integers(0, 2**31), st.integers(2, 8), st.integers(1, 5), st.integers(0, 3))
def test_solution_meets_both_rows_whatever_the_rank(seed, n, m, lost):
    rank = max(1, min(n - 1, m) - lost)
    D, W, b, c = problem(seed, n, m, rank)
    a, multipliers = solve(D, W, b, c)
    scale = 1 + np.abs(W).max() * np.abs(multipliers).max() + np.abs(b).max()
    kept = np.linalg.svd(W, compute_uv=False)[rank - 1] / np.linalg.norm(W)
    if kept < 1e-2:  # badly scaled draws say nothing about lost rank
        return
    np.testing.assert_allclose(D @ a - W.T @ multipliers, b, atol=1e-10 * scale)
    np.testing.assert_allclose(W @ a, c, atol=1e-9 * scale)


def test_redundant_multipliers_are_of_least_norm():
    D, W, b, c = problem(7, 6, 3, 3)
    twice = np.vstack([W, W])
    a, multipliers = solve(D, twice, b, np.concatenate([c, c]))
    S = twice @ np.linalg.solve(D, twice.T)
    expected = np.linalg.pinv(S) @ (np.concatenate([c, c]) - twice @ np.linalg.solve(D, b))
    # Rounding along the null space of W' is divided by mu = 1e-8; it makes no acceleration.
    np.testing.assert_allclose(multipliers, expected, rtol=1e-6)
    np.testing.assert_allclose(twice.T @ multipliers, twice.T @ expected, rtol=1e-9)
    np.testing.assert_allclose(a, solve(D, W, b, c)[0], rtol=1e-9)


def test_regularisation_leaves_no_trace_on_a_regular_problem():
    D, W, b, c = problem(3, 6, 2, 2)
    K = np.block([[D, -W.T], [W, np.zeros((2, 2))]])
    expected = np.linalg.solve(K, np.concatenate([b, c]))
    np.testing.assert_allclose(np.concatenate(solve(D, W, b, c)), expected, rtol=1e-12)


def test_a_closure_that_says_nothing_changes_nothing():
    """A second pin at a joint: W has no entry; with a closure that does, and alone."""
    D, W, b, c = problem(4, 5, 2, 2)
    nothing, zero = np.zeros((2, 5)), np.zeros(2)
    a, multipliers = solve(D, np.vstack([W, nothing]), b, np.r_[c, zero])
    np.testing.assert_allclose(a, solve(D, W, b, c)[0], rtol=1e-12)
    np.testing.assert_allclose(multipliers, np.r_[solve(D, W, b, c)[1], zero], rtol=1e-9)
    alone, multipliers = solve(D, nothing, b, zero)
    np.testing.assert_allclose(alone, np.linalg.solve(D, b), rtol=1e-12)
    assert not multipliers.any()


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_units_do_not_matter(scale):
    """Lengths in other units scale W and D; the solution scales with them."""
    D, W, b, c = problem(5, 5, 2, 2)
    a, multipliers = solve(D * scale**2, W * scale, b * scale**2, c * scale)
    a1, multipliers1 = solve(D, W, b, c)
    np.testing.assert_allclose(a, a1, rtol=1e-12)
    np.testing.assert_allclose(multipliers, multipliers1 * scale, rtol=1e-12)
