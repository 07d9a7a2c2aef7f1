"""What the shape of rates and phases cannot say. Each check yields (path in the file, message with
remedy)."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.orchestrator.base.faults import unknown
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene.blocks import fmu_rates
from hapticlink.orchestrator.scene.records import AnyRate, Rate, Seconds, VariableRate
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def check(scene: Scene) -> Iterator[Problem]:
    """Every fault found."""
    yield from _number(("haptics", "rate"), scene.haptics.rate)
    graphics = scene.graphics
    if graphics:
        yield from _rate(("graphics", "rate"), graphics.rate, scene)
        if graphics.phase is not None:
            yield from _phase(("graphics", "phase"), graphics.phase, graphics.rate)
        if graphics.align == "exact" and isinstance(graphics.rate, VariableRate | tuple):
            yield ("graphics", "align"), "'exact' needs a fixed rate: rates that vary are on ticks"
    for i, fmu in enumerate(scene.fmu):
        path: Path = ("fmu", i, "rate")
        if fmu.rate == "graphics" and not graphics:
            yield path, "there is no graphics rate: add [graphics] with its rate"
        elif fmu.rate not in ("haptics", "graphics"):
            yield from _rate(path, fmu.rate, scene, "'haptics', 'graphics', or ")
    yield from _phases(scene)


def _number(path: Path, rate: Rate, others: str = "") -> Iterator[Problem]:
    try:
        good = exact(rate) > 0
    except (ValueError, ZeroDivisionError):
        yield path, f"{rate!r}: write {others}a rate as 30, 29.97 or '30000/1001' (Hz)"
        return
    if not good:
        yield path, f"{rate} Hz: a rate is more than 0"


def _rate(path: Path, rate: AnyRate, scene: Scene, others: str = "") -> Iterator[Problem]:
    if isinstance(rate, VariableRate):
        bounds = [*_number((*path, "min"), rate.min), *_number((*path, "max"), rate.max)]
        yield from bounds
        if not bounds and exact(rate.min) > exact(rate.max):
            yield (*path, "min"), f"{rate.min} Hz is above max = {rate.max} Hz: swap them"
        if rate.seed < 0:
            yield (*path, "seed"), f"{rate.seed}: a seed is 0 or more"
    elif isinstance(rate, tuple):
        if not rate or rate[-1] < scene.duration:
            yield path, f"the times end before duration = {scene.duration} s: add more"
        if any(b <= a for a, b in zip((0.0, *rate), rate, strict=False) if b != 0.0):
            yield path, "times must rise: sort them and drop repeated ones"
    else:
        yield from _number(path, rate, others)


def _phases(scene: Scene) -> Iterator[Problem]:
    known = fmu_rates(scene)
    for fmu, phase in scene.phases.items():
        path: Path = ("phases", fmu)
        if fmu not in known:
            yield path, unknown("FMU", fmu, known)
            continue
        rate = known[fmu]
        if rate == "haptics":
            rate = scene.haptics.rate
        elif rate == "graphics":
            if not scene.graphics:
                continue  # told of already
            rate = scene.graphics.rate
        yield from _phase(path, phase, rate)


def _phase(path: Path, phase: Seconds, rate: AnyRate) -> Iterator[Problem]:
    if isinstance(rate, VariableRate | tuple):
        yield path, "a phase needs a fixed rate: steps of a rate that varies have none"
        return
    try:
        first = exact(phase)
    except (ValueError, ZeroDivisionError):
        yield path, f"{phase!r}: write a phase as 0.0005 or '1/2048' (s)"
        return
    try:
        period = 1 / exact(rate)
    except (ValueError, ZeroDivisionError):
        return  # told of already
    if not 0 < first <= period:
        yield path, f"{phase} s: the first step ends after 0 and within a period, {period} s"
