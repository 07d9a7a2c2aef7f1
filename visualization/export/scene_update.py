"""A frame of a mechanism's drawing as foxglove.SceneUpdate, in m in the plane z = 0, what is drawn
later a little above what is drawn before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticlink.visualization.mechanism import mark_places
from hapticlink.visualization.mechanism.mark_places import MM, Points
from hapticlink.visualization.mechanism.marks import SHAPES, Mark, reach

if TYPE_CHECKING:
    from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

WORLD = "world"
"""The frame of reference."""
POINTS_ACROSS = 250.0
"""Length (pt) of the largest extent of the bodies, which gives what has its size in points one."""
ROUND = 16
"""Corners of a small circle, at most."""
LAYER = 1 / 16
"""Height (pt) of a mark above the one before it."""
PIXELS = 1.5
"""Width of lines to a point."""


class SceneDrawing:
    """Draws frames with `marks`, all of them at the scale of the first."""

    def __init__(self, marks: Sequence[Mark], frame: Mapping[str, Any]) -> None:
        self._marks = marks
        bodies = [mark_places.points(mark, frame) for mark in marks if mark.role == "body"]
        found = np.vstack([at for at in bodies if at is not None])
        self._point = float(np.ptp(found, axis=0).max()) / MM / POINTS_ACROSS or 1e-3

    def update(self, frame: Mapping[str, Any], nanoseconds: int) -> SceneUpdate:
        """The message that replaces what is drawn by a frame."""
        from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

        made = SceneUpdate()
        entity = made.entities.add(id="mechanism", frame_id=WORLD)
        entity.timestamp.FromNanoseconds(nanoseconds)
        for layer, mark in enumerate(self._marks):
            if (at := mark_places.points(mark, frame)) is not None:
                self._draw(entity, mark, at / MM, frame, layer * LAYER * self._point)
        return made

    def _draw(
        self, entity: SceneEntity, mark: Mark, at: Points, frame: Mapping[str, Any], z: float
    ) -> None:
        if mark.kind == "arrow":
            self._arrow(entity, mark, at[0], frame, z)
        elif mark.kind == "disc":
            size = {"x": 2 * mark.size, "y": 2 * mark.size, "z": LAYER * self._point}
            look = {"pose": pose(at[0], z), "color": _color(mark.fill), "size": size}
            entity.cylinders.add(bottom_scale=1.0, top_scale=1.0, **look)
        elif mark.kind == "directions":
            reach_m = POINTS_ACROSS * self._point
            for way in reach(frame, mark.vector) or ():
                _line(entity, mark, at[0] + reach_m * np.outer([-1, 1], way), z)
        else:
            if mark.kind in SHAPES:
                corners = mark_places.shape(mark, frame) * self._point
                corners = corners[:: -(-len(corners) // ROUND)]
                at = at[0] + np.vstack([corners, corners[:1]])
            if mark.fill:
                _area(entity, mark, at, z)
            if mark.stroke:
                _line(entity, mark, at, z)

    def _arrow(
        self, entity: SceneEntity, mark: Mark, at: Points, frame: Mapping[str, Any], z: float
    ) -> None:
        if (tip := mark_places.arrow(mark, frame)) is None:
            return
        length, width = float(np.hypot(*tip)) * self._point, mark.width * self._point
        head = min(4 * width, length)
        turned = pose(at, z, float(np.arctan2(tip[1], tip[0])))
        look = {"pose": turned, "color": _color(mark.stroke)}
        shaft = {"shaft_length": length - head, "shaft_diameter": width}
        entity.arrows.add(**shaft, head_length=head, head_diameter=3 * width, **look)


def _line(entity: SceneEntity, mark: Mark, at: Points, z: float) -> None:
    look = {"pose": pose((0.0, 0.0), z), "color": _color(mark.stroke)}
    width = PIXELS * mark.width
    entity.lines.add(points=_points(at), thickness=width, scale_invariant=True, **look)


def _area(entity: SceneEntity, mark: Mark, at: Points, z: float) -> None:
    """A convex polygon, of triangles that have its first corner."""
    look = {"pose": pose((0.0, 0.0), z), "color": _color(mark.fill)}
    corners = [i for k in range(2, len(at)) for i in (0, k - 1, k)]
    entity.triangles.add(points=_points(at), indices=corners, **look)


def _points(at: Points) -> list[dict[str, float]]:
    return [{"x": x, "y": y} for x, y in at.tolist()]


def pose(at: Sequence[float] | Points, z: float = 0.0, angle: float = 0.0) -> Any:
    """The foxglove.Pose of a point (m) turned by an angle (rad) about z."""
    turn = {"z": np.sin(angle / 2), "w": np.cos(angle / 2)}
    return {"position": {"x": at[0], "y": at[1], "z": z}, "orientation": turn}


def _color(written: str | None) -> dict[str, float]:
    """The foxglove.Color of #rrggbb or #rrggbbaa."""
    parts = bytes.fromhex(f"{written or '#000000'}ff"[1:9])
    return {name: part / 255 for name, part in zip("rgba", parts, strict=True)}
