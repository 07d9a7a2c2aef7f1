"""The warning of friction that steps do not resolve: a slider whose friction stops its spring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl

SLIDER = """
title = "A slider on a spring rubs on its rail"
duration = 2.0
haptics.rate = 128

[linkage]
operational_point = { body = "slider" }
start = { rail = 0.103 }
body = [{ name = "slider", mass = 0.5, inertia = 1e-3 }]

[[linkage.joint]]
name = "rail"
type = "prismatic"
axis = 0.0
child = "slider"
stiffness = 200.0
friction = 1.0
"""


def rate(t: np.ndarray) -> np.ndarray:
    """Half cycles about f/k = 0.005 m on alternating sides, each of an amplitude 2 f/k smaller."""
    turns = np.floor(20 * t / np.pi)
    return -20 * (0.098 - 0.01 * turns) * np.sin(20 * t)


@pytest.mark.parametrize(("substeps", "low", "high"), [(1, 0.02, 0.2), (16, 0.0, 0.005)])
def test_turns_that_cost_the_rate_are_told(
    tmp_path: Path, substeps: int, low: float, high: float
) -> None:
    path = tmp_path / "slider.toml"
    path.write_text(SLIDER)
    run = hl.run(path, {"mechanism.substeps": substeps, "duration": 1.4})
    assert run.run["friction_speeds"] == {"rail": pytest.approx(4 * 1.0 / 0.5 / 128 / substeps)}
    table = run["haptics"]
    exact = rate(table["time"])
    error = np.abs(table["virtual_mechanism.qd"][:, 0] - exact).max() / np.abs(exact).max()
    assert low < error < high
    told = [line for line in run.run["warnings"] if "friction of rail" in line]
    assert len(told) == (substeps == 1)
