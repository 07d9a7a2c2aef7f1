"""A scene at rates whose hyperperiod is short enough to linearise."""

from __future__ import annotations

from hapticlink.analysis.stability.lifted_map import hyperperiod
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.timeline import timeline

EVENTS = 600
"""Haptic periods after which all has to repeat in a scene that is judged at its own rates."""


def short(read: Scene) -> tuple[Scene, str]:
    """The scene as it is judged, and which rate is rounded in it: where its events repeat only
    after more than EVENTS, as of 29.97 and 512 Hz after 100 s, frames are whole haptic periods.
    Raises InputFault for a rate that varies."""
    period = repetition(read)
    if read.graphics is None or period * float(read.haptics.rate) <= EVENTS:
        return read, ""
    return round_rate(read)


def round_rate(read: Scene) -> tuple[Scene, str]:
    """A scene that has a graphics rate in whole frames, and a sentence that says so. Raises
    InputFault for one that varies."""
    whole = float(exact(read.haptics.rate)) / frame_length(read)
    why = f"with its own rates all repeats only after {repetition(read):.4g} s"
    return whole_frames(read), f"judged with graphics at {whole:.5g} Hz: {why}"


def repetition(read: Scene) -> float:
    """The time (s) after which the events of all clocks of a scene repeat."""
    time = timeline(read)
    return time.seconds(hyperperiod(time))


def whole_frames(read: Scene) -> Scene:
    """The scene at the graphics rate next to its own with which frames are whole haptic periods.
    Raises InputFault for one that varies."""
    if read.graphics is None:
        return read
    rate = exact(read.haptics.rate) / frame_length(read)
    return open_scene.load(read, [f'graphics.rate="{rate}"'])


def frame_length(read: Scene) -> int:
    """Whole haptic periods next to a frame of the scene, which has a graphics rate. Raises
    InputFault for one that varies."""
    assert read.graphics is not None
    if not isinstance(read.graphics.rate, int | float | str):
        raise InputFault(
            "graphics.rate varies, so that there is no map of a period: take a fixed rate, such as "
            "--set graphics.rate=30"
        )
    return max(1, round(exact(read.haptics.rate) / exact(read.graphics.rate)))
