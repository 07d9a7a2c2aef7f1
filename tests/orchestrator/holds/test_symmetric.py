"""Eigenvalues and eigenvectors of symmetric matrices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hapticlink.orchestrator.holds.symmetric import eigen


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 10), st.integers(-12, 12))
def test_eigenvalues_are_those_of_lapack(seed: int, n: int, power: int) -> None:
    generator = np.random.default_rng(seed)
    basis = np.linalg.qr(generator.normal(size=(n, n)))[0]
    wanted = generator.choice([0.0, 1.0, -1.0, 3.0, generator.normal()], n) * 10.0**power
    matrix = basis * wanted @ basis.T
    matrix = (matrix + matrix.T) / 2
    values, vectors = (np.array(found) for found in eigen(matrix.tolist()))
    size = max(np.abs(matrix).max(), 1e-300)
    assert np.abs(np.sort(values) - np.linalg.eigvalsh(matrix)).max() <= 2e-14 * size
    assert np.abs(vectors.T @ vectors - np.eye(n)).max() <= 2e-14
    assert np.abs(vectors * values @ vectors.T - matrix).max() <= 4e-14 * size


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_diagonal_matrices_stay_as_they_are(n: int) -> None:
    values, vectors = eigen(np.diag(np.arange(n, dtype=float)).tolist())
    assert values == [*map(float, range(n))]
    assert np.array_equal(vectors, np.eye(n))
