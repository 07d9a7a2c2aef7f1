"""Passivity of the user's port against the closed form of Colgate and Schenkel."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator.stability import wall_limits

T = 1 / 512
WALL: dict[str, Any] = {
    "fmu.wall.settings.unilateral": False,
    "fmu.wall.settings.damping": 1.0,
    "hand.wrench": [0.0, 0.0, 0.0],
}


@pytest.mark.parametrize(
    ("K", "B", "late", "needed"),
    [
        (3000.0, 2.0, 0, 3000 * T / 2 + 2),
        (5000.0, 0.5, 0, 5000 * T / 2 + 0.5),
        (2000.0, -1.0, 0, 2000 * T / 2 + 1),
        (1000.0, 0.0, 1, 1000 * (T / 2 + T)),
        (1000.0, 3.0, 1, None),
    ],
)
def test_a_wall_needs_the_damping_of_the_closed_form(
    K: float, B: float, late: int, needed: float | None
) -> None:
    """b > K T/2 + |B|, with a delay and no damper K (T/2 + t_d); else the largest of the formula
    over the frequency. The device has 5 N.s/m."""
    gains = {"fmu.wall.start.stiffness": K, "fmu.wall.start.damping": B}
    found = hl.passivity("virtual-wall", WALL | gains | {"delays": {"wall.F": late * T}})
    form = wall_limits.passive_damping(T, late, np.array([K]), np.array([B]))[0]
    assert found.needed == pytest.approx(needed or form, rel=1e-3)
    assert found.own == pytest.approx(5.0, rel=1e-3)
    assert found.passive == (found.needed <= 5.0)
    assert found.turning == 0.0


def test_a_mechanism_alone_gives_energy_to_no_hand() -> None:
    """With the wall left out of the loop (K = B = 0) nothing is needed."""
    gains = {"fmu.wall.start.stiffness": 0.0, "fmu.wall.start.damping": 0.0}
    found = hl.passivity("virtual-wall", WALL | gains)
    assert found.needed == pytest.approx(0.0, abs=1e-6)


def test_a_scene_without_a_hand_on_a_device_has_no_port() -> None:
    with pytest.raises(hl.InputFault, match="no port of a user"):
        hl.passivity("pendulum")
