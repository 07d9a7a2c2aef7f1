"""Which linkages the converters for Drake and Pinocchio know, and what all ask of one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hapticlink.components.specs.linkage import Joint, Linkage
from hapticlink.components.specs.quantities import Place

Vector = np.ndarray
End = tuple[str, Vector]
"""A body, and a point in its frame, (3,)."""
ALONG = 0.5
"""How far (m) along the axis of a pin in space the second point is that it holds."""


def require_comparable(linkage: Linkage) -> None:
    """Raises ValueError for what these would leave out or take for something else."""
    if linkage.sprung or linkage.driven or linkage.rubbing or linkage.limited:
        raise ValueError("forces of joints and springs are not compared")
    if linkage.gear or any(loop.type != "revolute" for loop in linkage.loop):
        raise ValueError("loops are compared that are closed by pins")
    for joint in linkage.joint:
        if not all(freedom.pure for freedom in joint.kind.freedoms):
            raise ValueError(f"{joint.name}: a {joint.type} joint is not compared")
        if linkage.dimension > 2 and joint.type != "revolute":
            raise ValueError(f"{joint.name}: in space revolute joints are compared")


def vector(numbers: Place | None) -> Vector:
    """A point or a direction with its z, which is 0 in the plane."""
    return np.array([*(numbers or (0.0, 0.0)), 0.0][:3])


def axis(joint: Joint) -> Vector:
    """The axis of a revolute joint."""
    given = joint.axis if isinstance(joint.axis, tuple) else (0.0, 0.0, 1.0)
    return np.array(given) / np.linalg.norm(given)


def pinned(linkage: Linkage) -> Iterator[tuple[End, End]]:
    """Points of two bodies that coincide: one of each pin that closes a loop in the plane, and two
    in space, on its axis."""
    for loop in linkage.loop:
        axes = loop.axes or ((0.0, 0.0, 1.0),) * 2
        for along in (0.0, ALONG) if linkage.dimension > 2 else (0.0,):
            ends = zip(loop.bodies, loop.at, axes, strict=True)
            first, second = (
                (body, vector(at) + along * np.array(way) / np.linalg.norm(way))
                for body, at, way in ends
            )
            yield first, second
