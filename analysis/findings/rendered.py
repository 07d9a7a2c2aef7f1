"""What a device renders, as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from hapticlink.components.specs.device import LIGHT, Handle
from hapticlink.orchestrator.results.numbers import short

UNTURNED = "renders forces, no moments"


def recorded_handle(scene: Mapping[str, Any], user: str = "") -> Handle | None:
    """The handle of a user's device in a scene as plain data; None without a device."""
    device = recorded_device(scene, user)
    return Handle(**device["handle"]) if device else None


def recorded_device(scene: Mapping[str, Any], user: str = "") -> Any:
    """A user's device in a scene as plain data."""
    return (scene.get("devices") or {}).get(user) if user else scene.get("device")


def describe_rendered(handle: Handle) -> str:
    """What a device with this handle renders, "" where that is all."""
    if handle.angle == "held":
        return ""
    if handle.along is not None:
        x, y = handle.along
        return f"{UNTURNED}: forces along ({x:g}, {y:g}) alone"
    how = "it holds the handle's angle" if handle.angle == "fixed" else "its handle is a point"
    return f"{UNTURNED}: {how}"


def describe_devices(scene: Mapping[str, Any]) -> Iterator[str]:
    """A line for each device of a scene, as plain data, that does not render all directions, and on
    what of a constant hand it does not pass on; and for each that is so light that velocity terms
    are compensated by default."""
    for user in ("", *(scene.get("devices") or {})):
        handle, of = recorded_handle(scene, user), f" of {user}" if user else ""
        if handle is None:
            continue
        if rendered := describe_rendered(handle):
            hand = (scene.get("hands") or {}).get(user) if user else scene.get("hand")
            moment = (hand or {}).get("wrench", (0.0, 0.0, 0.0))[2]
            lost = f"; the hand's moment, {short(moment)} N.m, reaches nothing" if moment else ""
            yield f"the device{of} {rendered}{lost}"
        own = scene.get("controller")
        controller = (scene.get("controllers") or {}).get(user, own) if user else own
        mass = sum(body["mass"] for body in recorded_device(scene, user)["body"])
        if mass < LIGHT and controller and controller["impedance"] and controller["bias"] is None:
            yield (
                f"the device{of} weighs {short(mass)} kg: velocity terms of the mechanism are "
                "compensated (controller.bias)"
            )
