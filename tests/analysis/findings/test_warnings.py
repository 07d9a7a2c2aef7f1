"""Warnings of a run: contacts that the hand does not feel, friction that steps do not resolve."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.findings.summary import describe_generated


@pytest.mark.parametrize(
    ("peak", "end", "said"),
    [
        (4e-4, -2e-4, "generated at most 0.4 mJ, and by the end has dissipated 0.2 mJ"),
        (4e-4, 2e-4, "generated at most 0.4 mJ, and by the end has generated 0.2 mJ"),
        (4e-4, 4e-4, "generated 0.4 mJ by the end, and at no time more"),
        (0.0, -2e-4, "generated no energy and dissipated 0.2 mJ"),
        (0.0, 0.0, "generated no energy"),
    ],
)
def test_energy_that_was_generated_in_words(peak: float, end: float, said: str) -> None:
    assert describe_generated(peak, end) == said


def warned(options: dict[str, object]) -> list[str]:
    made = hl.run("obstacles", {"duration": 0.6, **options})
    return [line for line in made.run["warnings"] if "controller.contact = true" in line]


def test_contacts_without_a_controller_that_renders_them() -> None:
    (line,) = warned({"controller.contact": False})
    assert "contacts act on the mechanism from 0." in line


@pytest.mark.parametrize(
    "options",
    [{}, {"controller.contact": False, "duration": 0.01}],
    ids=["rendered", "nothing is touched"],
)
def test_no_warning_without_cause(options: dict[str, object]) -> None:
    assert not warned(options)


SLIDER = {
    "duration": 1.4,
    "haptics.rate": 128,
    "linkage.body.bar.mass": 0.5,
    "linkage.start.slide": 0.103,
    "linkage.start_velocity.slide": 0.0,
    "linkage.joint.slide.stiffness": 200.0,
    "linkage.joint.slide.friction": 1.0,
}


def slid(t: np.ndarray) -> np.ndarray:
    """The rate (m/s) of a slider whose friction f stops its spring k: half cycles about f/k = 0.005
    m on alternating sides, each of an amplitude 2 f/k smaller."""
    turns = np.floor(20 * t / np.pi)
    return -20 * (0.098 - 0.01 * turns) * np.sin(20 * t)


@pytest.mark.parametrize(("substeps", "low", "high"), [(1, 0.02, 0.2), (16, 0.0, 0.005)])
def test_turns_that_cost_the_rate_are_told(
    bar: Path, substeps: int, low: float, high: float
) -> None:
    run = hl.run(bar, SLIDER | {"mechanism.substeps": substeps})
    assert run.run["friction_speeds"] == {"slide": pytest.approx(4 * 1.0 / 0.5 / 128 / substeps)}
    table = run["haptics"]
    exact = slid(table["time"])
    error = np.abs(table["virtual_mechanism.qd"][:, 0] - exact).max() / np.abs(exact).max()
    assert low < error < high
    told = [line for line in run.run["warnings"] if "friction of slide" in line]
    assert len(told) == (substeps == 1)
