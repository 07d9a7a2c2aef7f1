"""Checks rates and phases against each other and the duration, and numbers of [directions],
[delays] and [[power]] that limit each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hapticlink.orchestrator.base.errors import unknown
from hapticlink.orchestrator.base.ticks import exact
from hapticlink.orchestrator.scene.blocks import Blocks
from hapticlink.orchestrator.scene.rates import AnyRate, Seconds, VariableRate
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def check_rates(scene: Scene, blocks: Blocks) -> Iterator[Problem]:
    if exact(scene.duration) * exact(scene.haptics.rate) < 1:
        yield (
            ("duration",),
            f"{scene.duration} s is less than a haptic period, 1/({scene.haptics.rate} Hz): "
            "nothing would run",
        )
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
        elif fmu.rate not in (None, "haptics", "graphics"):
            yield from _rate(path, fmu.rate, scene)
    yield from _phases(scene, blocks.rates)


def _rate(path: Path, rate: AnyRate, scene: Scene) -> Iterator[Problem]:
    if isinstance(rate, VariableRate):
        if exact(rate.min) > exact(rate.max):
            yield (*path, "min"), f"{rate.min} Hz is above max = {rate.max} Hz: swap them"
    elif isinstance(rate, tuple):
        if not rate or rate[-1] < scene.stop_time:
            after = f"start_time = {scene.start_time} s and " if scene.start_time else ""
            yield path, f"the times end before {after}duration = {scene.duration} s: add more"
        if any(b <= a for a, b in zip((0.0, *rate), rate, strict=False) if b != 0.0):
            yield path, "times must rise: sort them and drop repeated ones"


def _phases(scene: Scene, known: Mapping[str, AnyRate]) -> Iterator[Problem]:
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
                continue  # reported already
            rate = scene.graphics.rate
        yield from _phase(path, phase, rate)


def _phase(path: Path, phase: Seconds, rate: AnyRate) -> Iterator[Problem]:
    if isinstance(rate, VariableRate | tuple):
        yield path, "a phase needs a fixed rate: steps of a rate that varies have none"
        return
    period = 1 / exact(rate)
    if exact(phase) > period:
        yield path, f"{phase} s: the first step ends within a period, {period} s"


def check_numbers(scene: Scene) -> Iterator[Problem]:
    """Problems of [directions], and of the signs of [[power]]."""
    factor = scene.directions.rank_tolerance * scene.directions.hysteresis
    if not factor < 1:
        yield (
            ("directions", "hysteresis"),
            f"{scene.directions.hysteresis} times rank_tolerance = "
            f"{scene.directions.rank_tolerance} is {factor:.6g}, a share that no direction "
            "exceeds: give less than 1 in all",
        )
    for i, port in enumerate(scene.power):
        if abs(port.sign) != 1.0:
            yield ("power", i, "sign"), f"{port.sign:g} is no sign: write 1 or -1"


def check_delays(scene: Scene) -> Iterator[Problem]:
    for name, late in scene.delays.items():
        if isinstance(late, Latency) and late.max is not None and late.max < late.min:
            message = f"max = {late.max} s is below min = {late.min} s: swap them"
            yield ("delays", name), message
