"""Tuned gains: their margin is where runs become unstable, and runs press to the felt stiffness."""

from __future__ import annotations

import numpy as np
import pytest

import hapticlink as hl
from hapticlink.orchestrator.scene.overrides import written
from hapticlink.orchestrator.tune import HANDS, Tuned, tune
from hapticlink.orchestrator.tune.held import spring
from hapticlink.orchestrator.tune.poses import FIRM

CASES = {"closed-loop": ("sensing=encoders", "graphics.rate=32")}


@pytest.fixture(scope="module", params=list(CASES))
def tuned(request: pytest.FixtureRequest) -> tuple[str, Tuned]:
    name = request.param
    return name, tune(name, CASES[name], neighbours=False)


def gains(found: Tuned, factor: float) -> list[str]:
    """The options of all tuned gains with stiffness by a factor, damping by its root."""
    powers = {"stiffness": factor, "damping": factor**0.5}
    return [
        *written(
            {
                f"{table}.{key}": (np.array(value) * powers[key]).tolist()
                for table, values in found.tables.items()
                for key, value in values.items()
            }
        )
    ]


def test_the_margin_is_that_asked_for(tuned: tuple[str, Tuned]) -> None:
    _, found = tuned
    assert found.margin >= found.asked * 0.99


def test_runs_chatter_just_beyond_the_margin_and_settle_before(tuned: tuple[str, Tuned]) -> None:
    """In both hands, from a start 0.1 mm off rest: 10 % below the margin the handle comes to rest,
    10 % above it does not."""
    name, found = tuned
    (pose,) = found.poses
    off = (pose.handle[0] + 1e-4, *pose.handle[1:])
    for hand in HANDS:
        late = []
        for share in (0.9, 1.1):
            options = [*CASES[name], *gains(found, found.margin * share), "duration=2.0"]
            options += [*written({"hand": spring(off, pose.press, hand)})]
            options += ["device.encoder_resolution=1e-12"]  # the map has none
            speed = np.abs(hl.run(name, options, figures=False)["haptic_device.v_true"])
            late.append(speed[-256:].max() / speed.max())
        assert late[0] < 0.05
        assert late[1] > 0.5


def test_pressing_gives_the_felt_stiffness(tuned: tuple[str, Tuned]) -> None:
    """A hand whose target swings along n: the handle's swing is n' X F, F the hand's, which is
    compared along the direction of constraint."""
    name, found = tuned
    for pose in found.poses:
        n = np.array(pose.along)
        push = spring(pose.handle, pose.press, FIRM)
        middle = np.array(push["target"][0][1:])  # type: ignore[index]
        swing = 2e-4 * n / np.abs(n).max()
        push["target"] = {
            "mean": middle.tolist(),
            "amplitude": swing.tolist(),
            "frequency": [found.hertz] * 3,
        }
        options = [*CASES[name], *gains(found, 1.0), *pose.options(())]
        options += [*written({"hand": push}), "duration=3.0", "device.encoder_resolution=1e-12"]
        run = hl.run(name, options, figures=False)
        assert run.fault is None
        window = run.haptics["time"] > 3.0 - 2 / found.hertz + 1e-9
        phase = np.exp(-2j * np.pi * found.hertz * run.haptics["time"][window])
        x, F = (
            (phase[:, None] * run[signal][window]).mean(axis=0)
            for signal in ("haptic_device.x_true", "hand.F")
        )
        predicted = found.compliances[pose.name] @ F
        assert n @ x == pytest.approx(n @ predicted, rel=0.03)


def test_what_cannot_be_tuned_is_refused() -> None:
    with pytest.raises(hl.InputFault, match="give 1 or more"):
        hl.tune("closed-loop", margin=0.5)
    with pytest.raises(hl.InputFault, match="no gains to tune"):
        hl.tune("pendulum")
