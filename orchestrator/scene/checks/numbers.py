"""Checks numbers of [directions], [device], [delays] and [[power]] that limit each other."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import Latency
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def check(scene: Scene) -> Iterator[Problem]:
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


def delays(scene: Scene) -> Iterator[Problem]:
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
