"""The model of a device, by the coordinates that suit it."""

from __future__ import annotations

from functools import lru_cache

from hapticlink.components.device.device_model import DeviceModel
from hapticlink.components.device.groups import dyads
from hapticlink.components.device.joint_coordinates import JointCoordinates
from hapticlink.components.device.pose_coordinates import PoseCoordinates
from hapticlink.components.specs.device import Device


@lru_cache(64)
def device_model(device: Device) -> DeviceModel:
    """The model of a device: coordinates of its handle where dyads reach every body, else those of
    its joints. Raises ValueError as `DeviceModel` does."""
    found = dyads(device)
    return JointCoordinates(device) if found is None else PoseCoordinates(device, found)
