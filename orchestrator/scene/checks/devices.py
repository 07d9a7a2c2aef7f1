"""Checks the linkage of each device as that of a scene, and what its joints say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.scene.checks.linkage import check_linkage
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem

_HANDLE: Path = ("linkage", "operational_point")


def check_devices(scene: Scene) -> Iterator[Problem]:
    for user, device in scene.all_devices.items():
        here: Path = ("devices", user) if user else ("device",)
        alone = replace(scene, linkage=device.linkage, graphics=None)
        for path, why in check_linkage(alone):
            inside = ("handle", *path[2:]) if path[:2] == _HANDLE else path[1:]
            yield (*here, *inside), why
        yield from _joints(device, here)


def _joints(device: Device, here: Path) -> Iterator[Problem]:
    for i, joint in enumerate(device.joint):
        if joint.range and not joint.range[0] < joint.range[1]:
            low, high = joint.range
            yield (*here, "joint", i, "range"), f"{low} is not below {high}: give both ends"
