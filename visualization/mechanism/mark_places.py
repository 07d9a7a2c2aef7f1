"""Where a mark is in a frame: the points that its line goes through, the corners of its shape and
the tip of its arrow, for whatever paints them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.visualization.mechanism.marks import SHAPES, Mark, Place, reach

Points = NDArray[np.float64]
Frame = Mapping[str, Any]
MM = 1e3
MIN_ARROW, MAX_ARROW = 3.0, 120.0
"""Lengths of arrows (pt); shorter ones are not drawn."""


def place(frame: Frame, of: Place) -> Points | None:
    """The place (mm) of a point in the frame, (2,)."""
    pose = reach(frame, of.path)
    if pose is None:
        return None
    angle, (x, y) = _angle(pose), of.point
    c, s = math.cos(angle), math.sin(angle)  # many single points, for which NumPy is slow
    return np.array([(pose[0] + c * x - s * y) * MM, (pose[1] + s * x + c * y) * MM])


def points(mark: Mark, frame: Frame) -> Points | None:
    """The points (mm) that the line of a mark goes through, (k, 2), or where a mark without a line
    is, (1, 2); None where the frame does not have them, or is not in the mark's state."""
    at = [found for each in mark.at if (found := place(frame, each)) is not None]
    if not at or (mark.when and mark.when not in frame.get("states", ())):
        return None
    found = np.array(at)
    match mark.kind:
        case "area":
            return np.vstack([found, found[:1]])
        case "rail":
            return _rail(mark, found, frame)
        case "spring":
            return _spring(*found)
    return found


def shape(mark: Mark, frame: Frame) -> Points:
    """The corners (pt) about its place of a mark of SHAPES, (k, 2)."""
    corners = np.array(SHAPES[mark.kind])
    if mark.angle is None:
        return corners
    return _turn(reach(frame, mark.at[-1].path), corners, mark.angle)


def arrow(mark: Mark, frame: Frame) -> Points | None:
    """The tip (pt) of an arrow from its place, (2,); None for one that is too short."""
    force = np.array(reach(frame, mark.vector) or (0.0, 0.0))[:2]
    length = mark.size * float(np.hypot(*force))
    return None if length < MIN_ARROW else force * mark.size * min(1.0, MAX_ARROW / length)


def _turn(pose: Sequence[float], at: Any, by: float = 0.0) -> Points:
    """Points, (2,) or (k, 2), of the frame of a pose, turned into the world's directions."""
    angle = by + _angle(pose)
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(at) @ [[c, s], [-s, c]]


def _angle(pose: Sequence[float]) -> float:
    return pose[2] if len(pose) > 2 else 0.0


def _rail(mark: Mark, at: Points, frame: Frame) -> Points:
    pose = reach(frame, mark.at[-1].path)
    along = _turn(pose, (mark.size * MM, 0.0), mark.angle or 0.0)
    along = -along if np.dot(at[1] - at[0], along) < 0 else along
    return at + np.array([-along, along])


def _spring(a: Points, b: Points) -> Points:
    along = b - a
    length = float(np.linalg.norm(along)) or 1.0
    across = np.array([-along[1], along[0]]) / length * min(0.04 * length, 6.0)
    waves = np.where(np.arange(13) % 2, 1.0, -1.0)[:, None] * across
    return np.vstack([a, a + np.linspace(0.2, 0.8, 13)[:, None] * along + waves, b])
