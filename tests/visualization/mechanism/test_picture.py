"""What is computed of the raw signals for a drawing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from hapticlink.visualization.mechanism.picture import Part, directions


def test_constrained_directions_are_those_of_the_projector() -> None:
    """Against the singular vectors of the projector's range, also where it has rank 2 out of the
    plane."""
    part = Part("", "directions", ("P_c",), (9,), directions(), sparse=True)

    def shown(projector: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array(part.value({"P_c": projector.ravel().tolist()})).reshape(-1, 2)

    line = np.array([math.cos(0.3), math.sin(0.3), 0.0])
    (found,) = shown(np.outer(line, line))
    assert abs(np.dot(found, line[:2])) == pytest.approx(1.0)
    assert len(shown(np.diag([0.0, 0.0, 1.0]))) == 0
    both = shown(np.diag([1.0, 1.0, 0.0]))
    assert np.allclose(both @ both.T, np.eye(2))
    basis, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 2)))
    _, sizes, axes = np.linalg.svd(basis[:2].T)
    found = shown(basis @ basis.T)
    assert np.hypot(*found.T) == pytest.approx(sizes)
    assert np.abs(np.sum(found * axes, axis=1)) == pytest.approx(sizes)
