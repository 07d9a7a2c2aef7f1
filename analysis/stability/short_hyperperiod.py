"""A scene at rates whose hyperperiod is short enough to linearise."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from hapticlink.analysis.search.settings import set_rate
from hapticlink.analysis.stability.lifted_map import hyperperiod
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.ticks import exact, write_exact
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.system.timeline import timeline

EVENTS = 1000
"""Haptic periods after which all has to repeat in a scene that is judged at its own rates: all
whole ones up to as many Hz."""
ROUNDED = 250
"""The most of a scene whose graphics rate is rounded."""


def short(read: Scene) -> tuple[Scene, str]:
    """The scene as it is judged, and which rate is rounded in it: where its events repeat only
    after more than EVENTS, as of 29.97 and 512 Hz after 100 s, as `in_periods` of ROUNDED has it.
    Raises InputFault for a rate that varies."""
    haptic = exact(read.haptics.rate)
    if read.graphics is None or repetition(read) * float(haptic) <= EVENTS:
        return read, ""
    return in_periods(read, ROUNDED)


def in_periods(read: Scene, most: int = 1) -> tuple[Scene, str]:
    """The scene with as many frames in a number of haptic periods, at most `most` or those of a
    frame, as come next to its rate, and a sentence that says so. Raises InputFault for a rate that
    varies.

    A frame that ends between two haptic ticks is seen at the later one, and one that ends on a tick
    at once, which of the scene's own frames hardly any does. So these end half of the distance
    beside ticks that others keep, unless the scene has a phase or FMUs that may refuse one."""
    haptic = exact(read.haptics.rate)
    assert read.graphics is not None
    share = (graphics_rate(read) / haptic).limit_denominator(max(most, frame_length(read)))
    first = (1 / share - Fraction(1, 2 * share.numerator)) / haptic
    late = [f"graphics.phase={write_exact(first)}"]
    return round_rate(read, share * haptic, [] if read.graphics.phase or read.fmu else late)


def round_rate(read: Scene, rate: Fraction, beside: Sequence[str] = ()) -> tuple[Scene, str]:
    """A scene with graphics at a rate (Hz) near its own and options beside, and a sentence that
    says so."""
    why = f"with its own rates all repeats only after {repetition(read):.4g} s"
    rounded = open_scene.load(read, [set_rate("graphics", rate), *beside])
    return rounded, f"judged with graphics at {float(rate):.7g} Hz: {why}"


def repetition(read: Scene) -> float:
    """The time (s) after which the events of all clocks of a scene repeat."""
    return (time := timeline(read)).seconds(hyperperiod(time))


def whole_frames(read: Scene) -> tuple[Scene, str]:
    """The scene as it repeats after a frame: where its own frames are no whole haptic periods,
    `in_periods` of one. Raises InputFault for a rate that varies."""
    if read.graphics is None or (exact(read.haptics.rate) / graphics_rate(read)).denominator == 1:
        return read, ""
    return in_periods(read)


def frame_length(read: Scene) -> int:
    """Whole haptic periods next to a frame of the scene, which has a graphics rate. Raises
    InputFault for one that varies."""
    return max(1, round(exact(read.haptics.rate) / graphics_rate(read)))


def graphics_rate(read: Scene) -> Fraction:
    """Its rate (Hz). Raises InputFault for one that varies."""
    assert read.graphics is not None
    if not isinstance(read.graphics.rate, int | float | str):
        raise InputFault(
            "graphics.rate varies, so that there is no map of a period: take a fixed rate, such as "
            "--set graphics.rate=30"
        )
    return exact(read.graphics.rate)
