"""The extent of a device's workspace, as text."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from hapticlink.analysis.findings.rendered import describe_rendered
from hapticlink.components.device.workspace import Range, extents_along, margin, workspace
from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.scene.start_pose import describe_start_outside

Pose = Sequence[float]
"""x m, y m, theta rad."""


def lines(device: Device, start: Pose) -> Iterator[str]:
    """The extent of the workspace, what the device renders, where its numbers are from, and whether
    the start pose of a scene is inside the workspace."""
    if device.handle.along is not None:
        (extent,) = extents_along(device)
        yield f"along {write_pose(device.handle.along)}: {_range(extent)}"
    elif not any(device.space.turns):
        named = zip(device.space.names, extents_along(device), strict=True)
        along = ", ".join(f"{name} {_range(extent)}" for name, extent in named)
        yield f"on lines through the device's start: {along}"
    else:
        yield from _extents(device)
    if rendered := describe_rendered(device.handle):
        yield rendered
    yield from (f"{what}: {told}" for what, told in vars(device.origin).items() if told)
    distance = float(margin(device, np.array([start]))[0])
    if distance < 0:
        yield f"warning: {describe_start_outside(device.space, start)}"
    else:
        yield f"the handle starts at {write_pose(start)}, {distance:.3g} m from the nearest stop"


def _extents(device: Device) -> Iterator[str]:
    space = workspace(device)
    fields = {"at some theta: ": space.some, "at every theta: ": space.every}
    for which, field in fields.items() if len(space.theta) > 1 else [("", space.some)]:
        extent = space.extent(field)
        where = f"x {_range(extent[0])}, y {_range(extent[1])}" if extent else "nowhere"
        yield f"{which}{where}"
    if len(space.theta) > 1:
        turns = (
            "any" if space.turns == [_TURN] else ", ".join(_range(t, "rad") for t in space.turns)
        )
        yield f"theta: {turns}"


def write_pose(pose: Pose) -> str:
    """A pose as text, without what is rounding of 0."""
    return f"({', '.join(f'{round(value, 7) + 0.0:.4g}' for value in pose)})"


_TURN = (-math.pi, math.pi)


def _range(of: Range | None, unit: str = "m") -> str:
    return f"{of[0]:.2g} to {of[1]:.2g} {unit}" if of else "nowhere"
