"""What a frame says, against the results of the same run."""

from __future__ import annotations

from typing import Any

import pytest

import hapticlink as hl
from hapticlink.visualization.live.frames import Frames
from hapticlink.visualization.live.mouse_hand import viewed
from hapticlink.visualization.mechanism.picture import PORT


def test_the_energy_at_the_users_port_is_that_of_the_results() -> None:
    frames: list[Frames] = []
    seen: list[dict[str, Any]] = []

    def turn(live: hl.RealTime) -> None:
        if not frames:
            frames.append(Frames(live))
            live.set("hand.stiffness", (100.0, 100.0, 0.0))
            live.set("hand.target", (0.03, 0.03, 0.0))
        seen.append(frames[0].frame(live))
        if live.time > 0.3 and "light" in seen[-1]:
            live.stop()

    made = hl.RealTime(viewed("closed-loop", ["haptics.rate=512"])).run(turn)
    x = made["virtual_mechanism.x"][made.time("virtual_mechanism.x") == seen[-1]["t"]]
    assert seen[-1]["x"] == x[0].tolist()
    assert abs(seen[-1]["energy"][PORT]) > 1e-6
    assert seen[-1]["energy"][PORT] == pytest.approx(made.run["user_port"]["generated"], rel=1e-9)
