"""Hands whose divergence leads nowhere: a rod upside down between its limits, 0.02 rad to each
side."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.analysis.stability import judge_scene
from hapticlink.analysis.stability.hand_cases import NOWHERE
from hapticlink.analysis.stability.hands import OWN
from hapticlink.analysis.stability.margin_and_remedy import Margin

UP, OF_HAND = math.pi / 2, 0.025


def leaning(coupling: float, late: int) -> dict[str, Any]:
    """The scene with a stiffness of the coupling (N.m/rad), which hears of the rod so many periods
    later, and a rod that is 8 % too heavy for it."""
    holds = 1 / (1 / OF_HAND + 1 / coupling)
    pivot = {"lower": UP - 0.02, "upper": UP + 0.02, "stiffness": 5.0, "damping": 0.01}
    rod = {"name": "rod", "mass": 1.08 * holds / 0.05, "inertia": 1e-4, "center": [0.05, 0.0]}
    return {
        "haptics.rate": 800,
        "graphics.rate": 50,
        "hold": "zoh",
        "controller.topology": False,
        "controller.bias": "full",
        "controller.teleoperation.stiffness": [60.0, 60.0, coupling],
        "controller.teleoperation.damping": [10.0, 10.0, 0.01],
        "delays": {f"virtual_mechanism.{x}": late / 800 for x in "xv" if late},
        "linkage": {
            "gravity": [0.0, -1.0],
            "operational_point": {"body": "rod", "at": [0.0, 0.0]},
            "body": [rod],
            "joint": [{"name": "pivot", "child": "rod", "damping": 2e-4, "limits": pivot}],
            "start": {"pivot": UP},
        },
        "hand": {
            "type": "spring",
            "stiffness": [100.0, 100.0, OF_HAND],
            "damping": [5.0, 5.0, 1e-3],
            "target": [[0.0, 0.0, 0.0, UP]],
        },
    }


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The hands with which margins are searched."""
    hands: list[str] = []

    def improvements(*given: Any) -> tuple[Margin, tuple[()]]:
        hands.extend(given[2])
        return Margin(None, None, None), ()

    monkeypatch.setattr(judge_scene, "improvements", improvements)
    return hands


def test_each_hand_whose_divergence_leads_nowhere_says_so_whatever_others_do(
    searched: list[str],
) -> None:
    """A firm grip oscillates there, which is worse. A run that begins 2e-3 rad off stays."""
    scene = leaning(2.0, 2)
    found = hl.stability("closed-loop-ideal", scene, poses=1)
    cases = {case.hand: case for case in found.cases}
    assert found.worst.kind == "oscillation"
    assert (cases[OWN].kind, cases[OWN].verdict) == (NOWHERE, "marginal")
    assert cases[OWN].growth > 0.2
    assert found.margin.left_out == (OWN,)
    assert OWN not in searched
    assert "firm grip" in searched
    hand = scene["hand"] | {"target": [[0.0, 2e-4, 0.0, UP + 2e-3]]}
    run = hl.run("closed-loop-ideal", scene | {"hand": hand, "duration": 20.0}, figures=False)
    moved = np.abs(run["virtual_mechanism.x"] - [0.0, 0.0, UP]).max(axis=0)
    assert run.fault is None
    assert 0.02 < moved[2] < 0.022


def test_where_every_hand_leads_nowhere_no_margin_is_told() -> None:
    found = hl.equilibrium_stability("closed-loop-ideal", leaning(0.5, 0))
    assert isinstance(found, hl.Stability)
    assert [case.kind for case in found.cases] == [NOWHERE]
    assert found.margin.left_out == (OWN,)
    (line,) = (line for line in found.lines() if line.startswith("margin at "))
    assert line.endswith(f"and hands with a {NOWHERE}): not searched, as no hand is left")
    assert found.remedies == ()
