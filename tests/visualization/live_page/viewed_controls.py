"""The controls of a scene as its page offers them, and how stable it is with some of them set."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import hapticlink as hl
from hapticlink.analysis.stability.hand_cases import Case
from hapticlink.visualization.live_and_standalone.offered_controls import RATE, Settings, target
from hapticlink.visualization.live_and_standalone.prediction import judge_hands
from hapticlink.visualization.live_and_standalone.viewed_scene import load_viewed_scene
from hapticlink.visualization.live_page.controls import Controls
from hapticlink.visualization.live_page.frames import FrameReader


def begun(name: str) -> tuple[list[dict[str, Any]], dict[str, list[float]]]:
    """The controls of a scene at its start, and the parameters with which its mice hold there."""
    found: list[Any] = []

    def turn(live: hl.RealTime) -> None:
        its = Controls(live, {})
        handles = FrameReader(live).handles(live)
        held = {target(user): [*place] for user, place in handles.items()}
        found.extend((its.described(), its.parameters() | held))
        live.stop()

    hl.RealTime(load_viewed_scene(name, {"packaging": "python"})).run(turn, tables=False)
    return found[0], found[1]


def set_by(messages: list[dict[str, Any]]) -> dict[str, float]:
    """The values that messages of a page set, by control."""
    return {each["key"]: each["value"] for each in messages}


def judged(
    name: str, chosen: Mapping[str, float], parameters: Mapping[str, list[float]]
) -> Iterator[Case]:
    """The verdicts on a scene with controls as chosen, in the mouse's hand first."""
    settings: Settings = {RATE: 32.0} | dict(chosen)
    scaled = {
        gain: [settings.get(f"gains.{gain}", 1.0) * value for value in values]
        for gain, values in parameters.items()
    }
    return (case for case, _ in judge_hands(load_viewed_scene(name), settings, scaled))
