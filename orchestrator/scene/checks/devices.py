"""Checks the linkage of each device as that of a scene, and what its joints say."""

from __future__ import annotations

from collections.abc import Iterator

from hapticlink.components.specs.device import Device, Handle
from hapticlink.orchestrator.scene.checks.linkage import check_linkage
from hapticlink.orchestrator.scene.checks.space import check_joints_and_inertias
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem, path_of_user

_HANDLE: Path = ("linkage", "operational_point")


def check_devices(scene: Scene) -> Iterator[Problem]:
    for user, device in scene.all_devices.items():
        here = path_of_user("device", user)
        found = [*check_linkage(device.linkage)]
        if device.linkage.spatial:
            found += check_joints_and_inertias(device.linkage)
            yield from _of_the_plane(device, here)
        for path, why in found:
            inside = ("handle", *path[2:]) if path[:2] == _HANDLE else path[1:]
            yield (*here, *inside), why
        yield from _joints(device, here)


def _of_the_plane(device: Device, here: Path) -> Iterator[Problem]:
    """Problems of keys that a device in space does not have."""
    for key in ("angle", "along"):
        if getattr(device.handle, key) != getattr(Handle(body=""), key):
            text = "is of the plane: in space the handle is a point, of three forces: take it out"
            yield (*here, "handle", key), text
    for i, loop in enumerate(device.loop):
        if loop.type == "revolute":
            text = 'a pin is of the plane: in space take "spherical" or "rod"'
            yield (*here, "loop", i, "type"), text


def _joints(device: Device, here: Path) -> Iterator[Problem]:
    for i, joint in enumerate(device.joint):
        if joint.range and not joint.range[0] < joint.range[1]:
            low, high = joint.range
            yield (*here, "joint", i, "range"), f"{low} is not below {high}: give both ends"
