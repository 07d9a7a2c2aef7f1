"""The study of devices: its numbers against closed forms, and what its page counts."""

from __future__ import annotations

import numpy as np
import pytest

from studies.devices import measure, page
from tests.devices import device


def test_the_numbers_of_a_paddle_are_those_of_its_lever() -> None:
    """Mass I/(r cos phi)^2 up to the stops, at .8 rad, on the grid of the workspace; force tau
    15/r; the way of a count r delta."""
    found = measure.rendered(device("paddle"))
    lever = (4e-5 + 0.06 * 0.02**2 + 15**2 * 2e-7) / 0.07**2
    assert found.mass[0] == pytest.approx(lever, rel=0.01)
    assert lever < found.mass[1] <= lever / np.cos(0.8) ** 2
    assert found.force == pytest.approx(0.01 * 15 / 0.07)
    assert found.count == pytest.approx(0.07 * 1.0226538585904274e-4)
    assert found.noise == pytest.approx(lever * found.count * found.omega_n**2, rel=1e-6)


def test_a_twin_gives_its_least_force_in_the_worst_direction() -> None:
    """Four motors of .5 N.m with the norm of least torques, against a search over all
    directions."""
    twin = device("twin")
    found = measure.rendered(twin)
    model = measure.device_model(twin)
    z = measure.ca.SX.sym("z", 3)
    J = measure.ca.Function("J", [z], [model.jacobian(z, model.numbers)])(model.start_place)
    turns = np.linspace(0, 2 * np.pi, 721)
    asked = np.linalg.pinv(np.array(J).T) @ [np.cos(turns), np.sin(turns), 0 * turns]
    assert found.force == pytest.approx(0.5 / np.abs(asked).max(), rel=2e-3)


def row(says: str, run: str) -> dict[str, object]:
    check = measure.Check(0.8, says, "firm grip", -1.0, run)
    return {
        "device": "twin",
        "renders": "held",
        "verdict": "stable",
        "margin": 2.0,
        "checks": [{**vars(check), "agrees": check.agrees}],
        "rendered": vars(measure.Rendered((0.1, 0.2), 1.0, 1e-5, 50.0, 0.1)),
        "errors": {"ideal": (1.0, "duration", 3.0), "encoders": (2.0, "stop_when", 1.0)},
        "without_topology": {"ideal": (9.0, "stop_when", 2.0), "encoders": (3.0, "duration", 12.0)},
    }


@pytest.mark.parametrize(
    ("says", "run", "counted"),
    [
        ("stable", "stable", "1 of 1 devices agree with their runs, 1 of 1"),
        ("unstable", "stable", "0 of 1 devices agree with their runs, 0 of 1"),
        ("marginal", "stable", "1 of 1 devices agree with their runs, 0 of 0"),
    ],
)
def test_a_page_counts_the_verdicts_that_runs_bear_out(says: str, run: str, counted: str) -> None:
    text = page.text([row(says, run)])
    assert counted in text
    assert "| twin | forces and moments | 200 | 0.1 to 0.2 |" in text
    assert "| twin | 1 | 2 (left at 1 s) |" in text
    assert "| twin | 9 (left at 2 s) | 3 |" in text
