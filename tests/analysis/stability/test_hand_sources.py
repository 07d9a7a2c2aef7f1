"""The arms in which scenes are judged, against the impedance at the hand of a planar arm of two
links from published numbers (docs/equilibrium.md): M_x = J^-T M J^-1, and likewise K and B."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hapticlink.analysis.stability.hands import HANDS
from hapticlink.components.specs.hand import ArmHand

Matrix = NDArray[np.float64]
ELBOWS = np.radians([60.0, 90.0, 120.0])
SELEN = (0.31, 0.34, 1.93, 1.52, 0.04, 0.06, 0.155, 0.17)
"""Lengths, masses, inertias of upper arm and forearm: Selen, Franklin, Wolpert (2009), table 1; the
centres, which it does not have, in the middle."""
SIMULATED = (0.33, 0.34, 1.93, 1.52, 0.0141, 0.0188, 0.165, 0.19)
"""As used for the arm of Shadmehr, Mussa-Ivaldi (1994), with joint stiffness and damping."""
STIFFNESS = np.array([[15.0, 6.0], [6.0, 16.0]])
DAMPING = np.array([[2.3, 0.09], [0.09, 2.4]])


def at_hand(arm: tuple[float, ...], elbow: float, joint: Matrix | None) -> Matrix:
    """The least and the largest eigenvalue at the hand; of the inertia without `joint`."""
    a, b, m1, m2, I1, I2, c1, c2 = arm
    J = np.array([[-b * np.sin(elbow), -b * np.sin(elbow)],
                  [a + b * np.cos(elbow), b * np.cos(elbow)]])  # fmt: skip
    far, both = I2 + m2 * c2**2, m2 * a * c2 * np.cos(elbow)
    inertia = [[I1 + m1 * c1**2 + m2 * a**2 + far + 2 * both, far + both], [far + both, far]]
    back = np.linalg.inv(J)
    return np.linalg.eigvalsh(back.T @ (np.array(inertia) if joint is None else joint) @ back)


def test_arms_are_within_the_published_ranges_that_the_docs_state() -> None:
    masses = [at_hand(arm, e, None) for arm in (SELEN, SIMULATED) for e in ELBOWS]
    stiffness, damping = (
        [at_hand(SIMULATED, e, joint) for e in ELBOWS] for joint in (STIFFNESS, DAMPING)
    )
    stated = ((masses, 0.63, 3.0), (stiffness, 44.0, 492.0), (damping, 5.6, 105.0))
    for found, low, high in stated:
        assert np.min(found) == pytest.approx(low, rel=0.01)
        assert np.max(found) == pytest.approx(high, rel=0.01)
    arms = {name: hand for name, hand in HANDS.items() if isinstance(hand, ArmHand)}
    assert len(arms) == 4
    assert all(0.63 <= hand.mass[0] <= 3.0 for hand in arms.values())
    posture, stiff = arms["arm in posture, firm grip"], arms["stiff arm, firm grip"]
    assert 44.0 <= posture.stiffness[0] <= 492.0
    assert 5.6 <= posture.damping[0] <= 105.0
    assert stiff.stiffness[0] < 2.1 * 492.0
    assert 5.6 <= stiff.damping[0] <= 105.0
    assert arms["arm at rest, soft grip"].stiffness[0] < 44.0
