"""Checks rates and phases against each other and the duration, and numbers of [directions],
[device], [delays] and [[power]] that limit each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hapticlink.components.specs.device import Device
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
        if not rate or rate[-1] < scene.duration:
            yield path, f"the times end before duration = {scene.duration} s: add more"
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
    """Problems of [directions], of devices, and of the signs of [[power]]."""
    factor = scene.directions.rank_tolerance * scene.directions.hysteresis
    if not factor < 1:
        yield (
            ("directions", "hysteresis"),
            f"{scene.directions.hysteresis} times rank_tolerance = "
            f"{scene.directions.rank_tolerance} is {factor:.6g}, a share that no direction "
            "exceeds: give less than 1 in all",
        )
    if scene.device:
        yield from _device(scene.device, ("device",))
    for name, device in scene.devices.items():
        yield from _device(device, ("devices", name))
    for i, port in enumerate(scene.power):
        if abs(port.sign) != 1.0:
            yield ("power", i, "sign"), f"{port.sign:g} is no sign: write 1 or -1"


def check_delays(scene: Scene) -> Iterator[Problem]:
    for name, late in scene.delays.items():
        if isinstance(late, Latency) and late.max is not None and late.max < late.min:
            message = f"max = {late.max} s is below min = {late.min} s: swap them"
            yield ("delays", name), message


def _device(device: Device, here: Path) -> Iterator[Problem]:
    if device.base_y_a >= device.base_y_b:
        message = (
            f"{device.base_y_a} m is not below base_y_b = {device.base_y_b} m: plane A reaches "
            "upward, plane B downward"
        )
        yield (*here, "base_y_a"), message
    reach = device.proximal_length + device.distal_length
    folded = abs(device.proximal_length - device.distal_length)
    if (2 * device.reach_limit - 1) * reach <= folded:
        least = (1 + folded / reach) / 2
        yield (
            (*here, "reach_limit"),
            f"{device.reach_limit} leaves an arm nothing between its two stops, as its links "
            f"differ by {folded:.6g} m: give more than {least:.6g}, or links of more equal lengths",
        )
