"""Tuned gains: their margin is where runs become unstable, and runs press to the felt stiffness.

The tunings are those of results/tune/, which take minutes; the gains, poses, margins and
compliances that they record are tried in runs of the FMUs.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.scene.overrides import written
from hapticlink.orchestrator.stability.linearise import linearised
from hapticlink.orchestrator.tune.held import held, spring
from hapticlink.orchestrator.tune.poses import FIRM, Pose
from hapticlink.orchestrator.tune.search import FINE, HANDS

RECORDED = Path(__file__).parents[2] / "results" / "tune"
TUNED = sorted(path.parent.name for path in RECORDED.glob("*/tune.json"))
NO_ENCODER = ("device.encoder_resolution=1e-12",)
"""The map has no quantisation."""


def recorded(name: str) -> dict[str, Any]:
    return json.loads((RECORDED / name / "tune.json").read_text(encoding="utf-8"))


def poses(found: Mapping[str, Any]) -> list[Pose]:
    return [Pose(**pose) for pose in found["poses"]]


def gains(found: Mapping[str, Any], factor: float) -> list[str]:
    """The options of all tuned gains with stiffness by a factor, damping by its root."""
    powers = {"stiffness": factor, "damping": factor**0.5}
    return [
        *written(
            {
                f"{table}.{key}": (np.array(value) * powers[key]).tolist()
                for table, values in found["gains"].items()
                for key, value in values.items()
            }
        )
    ]


def tuned_scene(name: str) -> str:
    return str(RECORDED / name / "tuned.toml")


@pytest.mark.parametrize("name", TUNED)
def test_the_margin_is_at_least_that_asked_for(name: str) -> None:
    found = recorded(name)
    assert found["margin"] >= found["margin_asked"] * (1 - 2 * FINE)


@pytest.mark.parametrize("name", TUNED)
def test_runs_settle_within_the_margin_and_not_beyond(name: str) -> None:
    """From 0.1 mm off rest in every pose and hand: 10 % below the margin the handle comes to rest
    in all of them, 10 % above it in one it does not."""
    found = recorded(name)
    late = {share: [] for share in (0.9, 1.1)}  # type: dict[float, list[float]]
    for pose in poses(found):
        off = (pose.handle[0] + 1e-4, *pose.handle[1:])
        for hand in HANDS:
            for share, left in late.items():
                options = [*gains(found, found["margin"] * share), *pose.options(())]
                options += [*written({"hand": spring(off, pose.press, hand)})]
                options += ["duration=3.0", *NO_ENCODER]
                run = hl.run(tuned_scene(name), options, figures=False)
                speed = np.abs(run["haptic_device.v_true"])
                left.append(np.inf if run.fault else speed[-256:].max() / speed.max())
    assert max(late[0.9]) < 0.05
    assert max(late[1.1]) > 0.5


@pytest.mark.parametrize("name", TUNED)
def test_pressing_gives_the_felt_stiffness(name: str) -> None:
    """A hand whose target swings along n: the handle's swing is n' X F, F the hand's."""
    found = recorded(name)
    hertz = found["frequency"]
    for pose in poses(found):
        n = np.array(pose.along)
        push = spring(pose.handle, pose.press, FIRM)
        middle = np.array(push["target"][0][1:])  # type: ignore[index]
        swing = 2e-4 * n / np.abs(n).max()
        push["target"] = {
            "mean": middle.tolist(),
            "amplitude": swing.tolist(),
            "frequency": [hertz] * 3,
        }
        options = [*pose.options(()), *written({"hand": push}), "duration=3.0", *NO_ENCODER]
        run = hl.run(tuned_scene(name), options, figures=False)
        assert run.fault is None
        window = run.haptics["time"] > 3.0 - 2 / hertz + 1e-9
        phase = np.exp(-2j * np.pi * hertz * run.haptics["time"][window])
        x, F = (
            (phase[:, None] * run[signal][window]).mean(axis=0)
            for signal in ("haptic_device.x_true", "hand.F")
        )
        X = np.array(found["compliance"][pose.name]) @ [1.0, 1j]
        assert n @ x == pytest.approx(n @ X @ F, rel=0.03), pose.name


def test_a_tuning_is_as_recorded() -> None:
    """Found again: margins and stiffnesses of the scene's own gains, and the tuned ones."""
    name = "closed-loop"
    before, again = recorded(name), hl.tune(name, recorded(name)["options"], neighbours=False)
    assert again.own == pytest.approx(before["margin_of_scene"], rel=2 * FINE)
    assert again.felt == pytest.approx(before["felt_stiffness"], rel=0.05)


def test_the_columns_that_are_carried_hold_all_modes() -> None:
    """A judgement carries the directions of the first equilibrium alone; the map linearised along
    all of them has the same spectral radius."""
    found = recorded("closed-loop")
    (pose,) = poses(found)
    with held(open_scene.load("closed-loop", pose.options(found["options"]))) as place:
        for scale in (0.1, 1.0, 3.0):
            place.growth(dict.fromkeys(("drift", "topology"), scale), HANDS[0])
            whole = linearised(place._map, place._at.point)
            radii = [np.abs(np.linalg.eigvals(at.A)).max() for at in (place._at, whole)]
            assert radii[0] == pytest.approx(radii[1], rel=1e-6)


def test_what_cannot_be_tuned_is_refused() -> None:
    with pytest.raises(hl.InputFault, match="give 1 or more"):
        hl.tune("closed-loop", margin=0.5)
    with pytest.raises(hl.InputFault, match="no gains to tune"):
        hl.tune("pendulum")
