"""A bar on a rail that a hand moves, sampled and as a plant, against closed forms."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import hapticlink as hl
from tests.orchestrator import coupled

HELD = {
    "duration": 0.5,
    "linkage.body.bar.mass": 2.0,
    "linkage.start_velocity.slide": 0.0,
    "hand.target": {
        "amplitude": [0.1, 0.0, 0.0],
        "frequency": [1.0, 0.0, 0.0],
        "phase": [0.3, 0.0, 0.0],
    },
    "hand.stiffness": [300.0, 300.0, 1.0],
    "hand.damping": [10.0, 10.0, 0.02],
}
K, B, GRIP_K, GRIP_B, BAR, ARM, OMEGA = 300.0, 10.0, 2000.0, 20.0, 2.0, 1.0, 2 * np.pi
PLANT = {"hand.timing": "continuous", "coupling": "iterated", "iteration.method": "newton"}


def exact(kind: str, t: float) -> float:
    """The bar's position: masses, springs and the target's sine and cosine, linear together."""
    pull, turn = [0.1 * K, 0.1 * B * OMEGA], [[0.0, OMEGA], [-OMEGA, 0.0]]
    if kind == "spring":
        matrix = np.zeros((4, 4))
        matrix[0, 1], matrix[1], matrix[2:, 2:] = 1, np.array([-K, -B, *pull]) / BAR, turn
    else:
        matrix = np.zeros((6, 6))
        matrix[0, 1] = matrix[2, 3] = 1
        matrix[1, :4] = np.array([-GRIP_K, -GRIP_B, GRIP_K, GRIP_B]) / BAR
        matrix[3] = np.array([GRIP_K, GRIP_B, -K - GRIP_K, -B - GRIP_B, *pull]) / ARM
        matrix[4:, 4:] = turn
    start = np.zeros(len(matrix))
    start[-2:] = np.sin(0.3), np.cos(0.3)
    return float((expm(matrix * t) @ start)[0])


def order(bar: Path, kind: str, rates: list[int], options: dict) -> float:
    errors = []
    for rate in rates:
        results = hl.run(bar, HELD | options | {"hand.type": kind, "haptics.rate": rate})
        assert results.run["fault"] is None
        errors.append(abs(results["virtual_mechanism.x"][-1][0] - exact(kind, 0.5)))
    return coupled.order(rates, errors)


@pytest.mark.parametrize("kind", ["spring", "arm"])
@pytest.mark.parametrize(
    ("options", "coarsest", "expected", "within"), [(PLANT, 200, 2, 0.03), ({}, 800, 1, 0.05)]
)
def test_order_of_the_coupling_of_a_hand(bar, kind, options, coarsest, expected, within):
    """As a plant, and sampled."""
    rates = [coarsest, 2 * coarsest, 4 * coarsest]
    assert order(bar, kind, rates, options) == pytest.approx(expected, abs=within)
