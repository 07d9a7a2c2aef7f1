"""The coordinate c(q) of a joint, on which springs, friction and limits act: Q = (dc/dq)' F.

For a joint of the tree it is its own of q. For a cut joint, which closes a loop, it is the angle of
the first body from the second, or the displacement of the first point from the second along the
axis of a joint that slides.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import loop_name
from hapticlink.components.specs.linkage import Joint, Linkage, Loop


@dataclass(frozen=True)
class JointCoordinate:
    """A joint of one coordinate, or a cut joint by its index."""

    name: str
    joint: Joint | Loop
    cut: int | None = None

    @property
    def unit(self) -> str:
        return self.joint.kind.freedom.unit

    @property
    def effort_unit(self) -> str:
        return self.joint.kind.freedom.effort_unit

    def value(self, model: LinkageModel) -> ca.SX:
        """c(q)."""
        if self.cut is None:
            return model.q[model.coordinate(self.name)]
        loop = model.linkage.loop[self.cut]
        first, second = (model.frames[body] for body in loop.bodies)
        if loop.kind.freedom.turns:
            return first.angle - second.angle
        along = second.rotation @ model.along(self.name, loop.axis)
        ends = [model.at(body, f"{self.name}.at{k}") for k, body in enumerate(loop.bodies, 1)]
        return ca.dot(along, ends[0] - ends[1])


def joints_with(linkage: Linkage, *keys: str) -> list[JointCoordinate]:
    """The joints, then the cut joints, that have one of the keys. Raises ValueError for a
    joint of several coordinates that has, and for a cut joint in space."""
    coordinates = []
    for j in linkage.joint:
        given = [key for key in keys if getattr(j, key) is not None]
        if given and j.kind.size > 1:
            raise ValueError(
                f"joint `{j.name}`: {', '.join(given)} act on one coordinate and a {j.type} joint "
                f"has {j.kind.count}; use a spring between points"
            )
        if given:
            coordinates.append(JointCoordinate(j.name, j))
    for i, loop in enumerate(linkage.loop):
        if any(getattr(loop, key) is not None for key in keys):
            if linkage.dimension > 2:
                raise ValueError(
                    f"loop `{loop_name(linkage, i)}`: {', '.join(keys)} act on joints of the tree "
                    "in space; cut the loop at another joint"
                )
            coordinates.append(JointCoordinate(loop_name(linkage, i), loop, i))
    return coordinates
