"""A body's frame in the world, in the plane (d = 2) or in space (d = 3).

Turns about one constant axis add their angles, so that a chain of such joints needs one cosine and
one sine a body: base R(axis, angle), where the base is what was turned about other axes before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca

from hapticlink.components.linkage.rotations import Z_AXIS, Axis, about


@dataclass(frozen=True)
class Frame:
    """origin (m, d x 1) and rotation (d x d); angle (rad) about an axis, None where the frame has
    not turned, from a base (d x d), None for the world."""

    origin: ca.SX
    rotation: ca.SX
    angle: ca.SX
    axis: Axis | None = None
    base: ca.SX | None = None

    @staticmethod
    def world(d: int) -> Frame:
        return Frame(ca.SX(d, 1), ca.SX.eye(d), ca.SX(0))

    def at(self, origin: ca.SX) -> Frame:
        """The frame at an origin. The rotation is made anew, so that its rounding does not depend
        on the bodies before."""
        d = origin.numel()
        turned = about(self.axis or Z_AXIS, self.angle)[:d, :d]
        rotation = turned if self.base is None else self.base @ turned
        return replace(self, origin=origin, rotation=rotation)

    def moved(self, origin: ca.SX) -> Frame:
        """The frame with another origin."""
        return replace(self, origin=origin)

    def turned(self, axis: Axis, angle: ca.SX) -> Frame:
        """The frame turned about an axis of its own."""
        if self.axis in (None, axis):
            turned = replace(self, angle=self.angle + angle, axis=axis)
        else:
            turned = replace(self, angle=angle, axis=axis, base=self.rotation)
        return turned.at(self.origin)

    def rotated(self, rotation: ca.SX) -> Frame:
        """The frame turned by a rotation matrix."""
        both = self.rotation @ rotation
        return Frame(self.origin, both, ca.SX(0), None, both)

    @property
    def fixed_axis(self) -> bool:
        """Whether the frame has turned about one axis of the world alone, or not at all."""
        return self.base is None

    def direction(self, axis: Axis) -> ca.SX:
        """An axis of the frame in the world's axes (d x 1): where the frame turns about it, that of
        its base."""
        vector, d = ca.SX(ca.sparsify(ca.DM(axis))), self.origin.numel()
        if self.axis != axis:
            return ca.sparsify(self.rotation @ vector[:d])
        return vector[:d] if self.base is None else self.base @ vector[:d]

    def point(self, local: ca.SX | None) -> ca.SX:
        """World position of a point of the body; None is the frame's origin."""
        return self.origin if local is None else self.origin + self.rotation @ local

    def local(self, point: ca.SX) -> ca.SX:
        """Position in the body's frame of a point of the world."""
        return self.rotation.T @ (point - self.origin)
