"""The extent of a device's workspace, as text."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from hapticlink.components.device.workspace import Range, margin, workspace
from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.scene.start_pose import describe_start_outside

Pose = Sequence[float]
"""x m, y m, theta rad."""


def lines(device: Device, start: Pose) -> Iterator[str]:
    """The extent of the workspace, and whether the start pose of a scene is inside it."""
    space = workspace(device)
    for which, field in (("some", space.some), ("every", space.every)):
        extent = space.extent(field)
        where = f"x {_range(extent[0])} m, y {_range(extent[1])} m" if extent else "nowhere"
        yield f"at {which} theta: {where}"
    turns = space.turns
    yield f"theta: {'any' if turns == [_TURN] else ', '.join(map(_range, turns)) + ' rad'}"
    distance = float(margin(device, np.array([start]))[0])
    if distance < 0:
        yield f"warning: {describe_start_outside(start, distance)}"
    else:
        yield f"the handle starts at {placed(start)}, {distance:.3g} m from the nearest stop"


def placed(pose: Pose) -> str:
    """A pose as text, without what is rounding of 0."""
    return f"({', '.join(f'{round(value, 7) + 0.0:.4g}' for value in pose)})"


_TURN = (-math.pi, math.pi)


def _range(of: Range) -> str:
    return f"{of[0]:.2g} to {of[1]:.2g}"
