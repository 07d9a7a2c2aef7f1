"""The timeline of a scene: its clocks, in exact ticks."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from hapticlink.orchestrator.base.errors import SceneFault
from hapticlink.orchestrator.base.ticks import (
    Clock,
    Frames,
    Timeline,
    align_to_ticks,
    common_base,
    exact,
    periodic,
    round_up_to_ticks,
    variable,
)
from hapticlink.orchestrator.scene.blocks import Blocks, blocks
from hapticlink.orchestrator.scene.rates import AnyRate, VariableRate
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path


def timeline(scene: Scene, planned: Blocks | None = None) -> Timeline:
    """The timeline with the clock `haptics` and those of all FMUs, of the blocks `planned` if they
    are known; it ends at the last haptic tick at or before the duration. Raises SceneFault for a
    rate that cannot be put on ticks."""
    haptic = 1 / exact(scene.haptics.rate)
    steps = math.floor(exact(scene.duration) / haptic)
    given = clocks(scene, planned)
    exactly = [p for p in given.paces.values() if not p.on_ticks]
    spans = [span for p in exactly for span in (_period(p), p.first or _period(p))]
    base = common_base(spans)
    a_tick = int(haptic / base)
    stepped = []
    for name, pace in given.paces.items():
        if not pace.on_ticks:
            starts: Sequence[int] = periodic(_period(pace), base, steps * a_tick, pace.first)
        else:
            try:
                frames = _on_ticks(pace, haptic, steps, exact(scene.start_time))
                if isinstance(frames, Frames):
                    starts = frames.times(a_tick)
                else:
                    starts = tuple(frame * a_tick for frame in frames)
            except ValueError as error:
                raise SceneFault(scene.title, [scene.place(pace.path, str(error))]) from error
        if name == "graphics":
            starts = _apply_rate_changes(scene, starts, base, a_tick, steps * a_tick)
        stepped.append(Clock(name, starts, pace.path))
    return Timeline(base, steps * a_tick, tuple(stepped), given.of, exact(scene.start_time))


SLOWEST = 1e-3
"""Rate (Hz) below which a clock that is given it would not tick within a run."""
GRAPHICS_RATE = "graphics.rate"
"""What `[[at]]` sets of a clock."""


def _apply_rate_changes(
    scene: Scene, starts: Sequence[int], base: Fraction, a_tick: int, end: int
) -> Sequence[int]:
    """The starts of graphics steps with the rates that `[[at]]` sets: from the first one at or
    after its time on, steps end on the first haptic tick (`a_tick` ticks) at or after whole
    periods."""
    for i, event in sorted(enumerate(scene.at), key=lambda pair: pair[1].time):
        if (rate := event.set.get(GRAPHICS_RATE)) is None:
            continue
        try:
            period = period_in_ticks(rate, base, a_tick)
        except ValueError as error:
            where = scene.place(("at", i, "set", GRAPHICS_RATE), str(error))
            raise SceneFault(scene.title, [where]) from error
        after = exact(event.time) - exact(scene.start_time)
        before = starts[: bisect_left(starts, after / base) + 1]
        begin = before[-1]
        count = max(math.ceil((end - begin) / period), 0) + 3
        later = (math.ceil((begin + k * period) / a_tick) * a_tick for k in range(1, count))
        starts = (*before, *later)
    return starts


def period_in_ticks(rate: object, base: Fraction, a_tick: int) -> Fraction:
    """The period, in ticks of `base` (s), of a clock that is given another rate (Hz) in a run.
    Raises ValueError for one below SLOWEST or above the haptic one, of steps of `a_tick` ticks."""
    fastest = 1 / (a_tick * base)
    is_number = isinstance(rate, int | float) and not isinstance(rate, bool)
    number = float(rate) if is_number else 0.0  # type: ignore[arg-type]
    if SLOWEST <= number < math.inf and exact(number) <= fastest:
        return 1 / (exact(number) * base)
    limits = f"from {SLOWEST:g} up to that of the haptics, {fastest}"
    raise ValueError(f"{rate!r}: give a rate (Hz) {limits}")


def _period(pace: ClockRate) -> Fraction:
    assert isinstance(pace.rate, Fraction)
    return 1 / pace.rate


def _on_ticks(pace: ClockRate, haptic: Fraction, steps: int, begin: Fraction) -> Sequence[int]:
    """Starts of steps that are aligned to haptic ticks, counted in haptic ticks from `begin` (s)
    on; of times at which steps end, those before that are left out."""
    if isinstance(pace.rate, VariableRate):
        low, high, seed = exact(pace.rate.min), exact(pace.rate.max), pace.rate.seed
        return variable(low, high, seed, haptic, steps)
    if isinstance(pace.rate, tuple):
        times = (exact(time) - begin for time in pace.rate)
        starts = round_up_to_ticks([time for time in times if time >= 0], haptic)
        # One more step, so that a last time at the end of the run has a communication point.
        return (*starts, 2 * starts[-1] - starts[-2])
    return align_to_ticks(_period(pace), haptic, steps, pace.first)


@dataclass(frozen=True)
class ClockRate:
    """When the clock `name` steps. rate: Hz, bounds (Hz), or the times (s) at which steps end.
    first: end of the first step (s), None where the rate varies. on_ticks: steps end on haptic
    ticks. path: the scene's key for it."""

    name: str
    rate: Fraction | VariableRate | tuple[float, ...]
    first: Fraction | None
    on_ticks: bool
    path: Path


@dataclass(frozen=True)
class Clocks:
    """of: the clock of each FMU. paces: the pace of each clock, the haptic one first."""

    of: Mapping[str, str]
    paces: Mapping[str, ClockRate]


def clocks(scene: Scene, planned: Blocks | None = None) -> Clocks:
    """The clocks of `scene`: `haptics` always, others only where an FMU runs at them."""
    paths: dict[str, Path] = {fmu.name: ("fmu", i, "rate") for i, fmu in enumerate(scene.fmu)}
    rates = (planned or blocks(scene)).rates
    of = {fmu: _of(fmu, rate, paths.get(fmu, ()), scene) for fmu, rate in rates.items()}
    paces = {"haptics": _pace("haptics", (), scene)}
    for pace in sorted(of.values(), key=lambda pace: pace.name != "graphics"):
        paces.setdefault(pace.name, pace)
    return Clocks({fmu: pace.name for fmu, pace in of.items()}, paces)


def _of(fmu: str, rate: AnyRate, path: Path, scene: Scene) -> ClockRate:
    pace = _pace(rate, path, scene)
    if fmu not in scene.phases or exact(scene.phases[fmu]) == pace.first:
        return pace
    first = exact(scene.phases[fmu])
    name = f"{pace.name}_at_{_text(first)}s"
    return replace(pace, name=name, first=first, path=("phases", fmu))


def _pace(rate: AnyRate, path: Path, scene: Scene) -> ClockRate:
    if rate == "haptics":
        return _pace(scene.haptics.rate, ("haptics", "rate"), scene)
    if rate == "graphics":
        assert scene.graphics is not None
        pace = _pace(scene.graphics.rate, ("graphics", "rate"), scene)
        phase = scene.graphics.phase
        first = pace.first if phase is None else exact(phase)
        on_ticks = pace.on_ticks or scene.graphics.align == "tick"
        return replace(pace, name="graphics", first=first, on_ticks=on_ticks)
    if isinstance(rate, VariableRate):
        low, high = _text(exact(rate.min)), _text(exact(rate.max))
        return ClockRate(f"{low}to{high}hz_seed{rate.seed}", rate, None, True, path)
    if isinstance(rate, tuple):
        name = next((fmu.name for fmu in scene.fmu if fmu.rate == rate), "graphics")
        return ClockRate(f"times_of_{name}", rate, None, True, path)
    same = exact(rate) == exact(scene.haptics.rate)
    name = "haptics" if same else f"{_text(exact(rate))}hz"
    return ClockRate(name, exact(rate), 1 / exact(rate), False, path)


def _text(number: Fraction) -> str:
    """A unique text for a number that can be part of a file name: 0.0005, 30000_1001."""
    short = f"{float(number):.12g}"
    return short if exact(short) == number else f"{number.numerator}_{number.denominator}"
