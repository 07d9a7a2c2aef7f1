"""Where a mark is in a frame: the points that its line goes through, the corners of its shape and
the tip of its arrow, on the page, for whatever paints them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.scene.toml_keys import value
from hapticlink.visualization.mechanism.marks import SHAPES, Mark, Place
from hapticlink.visualization.mechanism.view import PLANE_VIEW, View

Points = NDArray[np.float64]
Frame = Mapping[str, Any]
MM = 1e3
MIN_ARROW, MAX_ARROW = 3.0, 120.0
"""Lengths of arrows (pt); shorter ones are not drawn."""


def world(frame: Frame, of: Place) -> Sequence[float] | None:
    """Where a point is in the world (m), None where the frame does not have it."""
    pose = value(frame, of.path)
    if pose is None:
        return None
    if len(of.point) > 2:  # a place, with the columns of a rotation matrix where it has a frame
        turned = np.array(pose[3:]).reshape(-1, 3).T @ of.point if len(pose) > 3 else 0.0
        found: list[float] = (np.array(pose[:3]) + turned).tolist()
        return found
    angle, (x, y) = _angle(pose), of.point
    c, s = math.cos(angle), math.sin(angle)  # many single points, for which NumPy is slow
    return pose[0] + c * x - s * y, pose[1] + s * x + c * y


def place(frame: Frame, of: Place, view: View = PLANE_VIEW) -> Points | None:
    """The place (mm) on the page of a point in the frame, (2,)."""
    at = world(frame, of)
    return None if at is None else on_page(np.array(at) * MM, view)


def on_page(vectors: Any, view: View) -> Points:
    """Vectors of the world, (..., 2) or (..., 3), to the right and up on the page, (..., 2)."""
    given = np.asarray(vectors)
    return given if given.shape[-1] == 2 else given @ view.rows[:2].T


def in_order(marks: Iterable[Mark], frame: Frame, view: View) -> list[Mark]:
    """The marks from back to front: of the bodies in space, those that are farther from the eye
    before nearer ones."""

    def nearness(mark: Mark) -> float:
        ends = [at for each in mark.at if (at := world(frame, each)) is not None]
        return float(np.mean(ends @ view.rows[2, : len(ends[0])])) if ends else 0.0

    every = [*marks]
    bodies = iter(sorted((mark for mark in every if mark.role == "body"), key=nearness))
    return [next(bodies) if mark.role == "body" else mark for mark in every]


def points(mark: Mark, frame: Frame, view: View = PLANE_VIEW) -> Points | None:
    """The points (mm) on the page that the line of a mark goes through, (k, 2), or where a mark
    without a line is, (1, 2); None where the frame does not have them, or is not in the mark's
    state."""
    at = [found for each in mark.at if (found := place(frame, each, view)) is not None]
    if not at or (mark.when and mark.when not in frame.get("states", ())):
        return None
    found = np.array(at)
    match mark.kind:
        case "area":
            return np.vstack([found, found[:1]])
        case "rail":
            return _rail(*found)
        case "spring":
            return _spring(*found)
    return found


def shape(mark: Mark, frame: Frame) -> Points:
    """The corners (pt) about its place of a mark of SHAPES, (k, 2)."""
    corners = np.array(SHAPES[mark.kind])
    if mark.angle is None:
        return corners
    return _turn(value(frame, mark.at[-1].path), corners, mark.angle)


def vector(mark: Mark, frame: Frame, view: View = PLANE_VIEW) -> Points | None:
    """What is at the `vector` of a mark, without its moment, on the page: (2,), (k, 2) of several;
    None where the frame does not have it."""
    found = value(frame, mark.vector)
    if not found:
        return None
    return on_page(np.array(found)[..., : len(mark.at[0].point)], view)


def arrow(mark: Mark, frame: Frame, view: View = PLANE_VIEW) -> Points | None:
    """The tip (pt) of an arrow from its place, (2,); None for one that is too short."""
    force = vector(mark, frame, view)
    if force is None:
        return None
    length = mark.size * float(np.hypot(*force))
    return None if length < MIN_ARROW else force * mark.size * min(1.0, MAX_ARROW / length)


def _turn(pose: Sequence[float], at: Any, by: float = 0.0) -> Points:
    """Points, (2,) or (k, 2), of the frame of a pose, turned into the world's directions."""
    angle = by + _angle(pose)
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(at) @ [[c, s], [-s, c]]


def _angle(pose: Sequence[float]) -> float:
    return pose[2] if len(pose) > 2 else 0.0


def _rail(pin: Points, guide: Points, past: Points) -> Points:
    along = past - guide if np.dot(guide - pin, past - guide) >= 0 else guide - past
    return np.array([pin - along, guide + along])


def _spring(a: Points, b: Points) -> Points:
    along = b - a
    length = float(np.linalg.norm(along)) or 1.0
    across = np.array([-along[1], along[0]]) / length * min(0.04 * length, 6.0)
    waves = np.where(np.arange(13) % 2, 1.0, -1.0)[:, None] * across
    return np.vstack([a, a + np.linspace(0.2, 0.8, 13)[:, None] * along + waves, b])
