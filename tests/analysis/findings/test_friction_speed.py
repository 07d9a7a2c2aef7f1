"""The warning of friction that steps do not resolve: a slider whose friction stops its spring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl

SLIDER = {
    "duration": 1.4,
    "haptics.rate": 128,
    "linkage.body.bar.mass": 0.5,
    "linkage.start.slide": 0.103,
    "linkage.start_velocity.slide": 0.0,
    "linkage.joint.slide.stiffness": 200.0,
    "linkage.joint.slide.friction": 1.0,
}


def rate(t: np.ndarray) -> np.ndarray:
    """Half cycles about f/k = 0.005 m on alternating sides, each of an amplitude 2 f/k smaller."""
    turns = np.floor(20 * t / np.pi)
    return -20 * (0.098 - 0.01 * turns) * np.sin(20 * t)


@pytest.mark.parametrize(("substeps", "low", "high"), [(1, 0.02, 0.2), (16, 0.0, 0.005)])
def test_turns_that_cost_the_rate_are_told(
    bar: Path, substeps: int, low: float, high: float
) -> None:
    run = hl.run(bar, SLIDER | {"mechanism.substeps": substeps})
    assert run.run["friction_speeds"] == {"slide": pytest.approx(4 * 1.0 / 0.5 / 128 / substeps)}
    table = run["haptics"]
    exact = rate(table["time"])
    error = np.abs(table["virtual_mechanism.qd"][:, 0] - exact).max() / np.abs(exact).max()
    assert low < error < high
    told = [line for line in run.run["warnings"] if "friction of slide" in line]
    assert len(told) == (substeps == 1)
