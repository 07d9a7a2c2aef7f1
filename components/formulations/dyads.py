"""Dyads: the position of the two links at a loop's cut joint in closed form.

d is the vector from the pivot P of the first link, of length l1, to the known point at the other
end; X is the joint between the two links; sigma = +1 or -1 is the branch.

Three pivots, the second link of length l2 (law of cosines):

    X = P + a d + sigma b (-d_y, d_x),   a = (l1^2 - l2^2 + d.d)/(2 d.d),   b = sqrt(l1^2/d.d - a^2)

The second link slides along e, and its point is at P + d before it slides by s:

    X = P + d + e s,   s = -e.d + sigma sqrt(l1^2 - d.d + (e.d)^2)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import casadi as ca

from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Joint

Posed = Callable[[ca.SX], LinkageModel]


class Dyad(Protocol):
    @property
    def joints(self) -> tuple[Joint, Joint]: ...

    def side(self, model: LinkageModel) -> ca.SX:
        """A value in [-1, 1] whose sign is the branch; 0 where the branches meet."""

    def close(self, at: Posed, q: ca.SX, sigma: ca.SX) -> ca.SX:
        """q with the dyad's two coordinates replaced so that the loop closes; angles change by at
        most half a turn."""


@dataclass(frozen=True)
class Arm:
    """The link carried by `joint`, up to the point of its body given by the parameter `end`."""

    joint: Joint
    end: str

    def vector(self, model: LinkageModel) -> ca.SX:
        """The vector from the pivot to the end in the world (m)."""
        zero, p = ca.SX(2, 1), model.p
        along = p.get(self.end, zero) - p.get(f"{self.joint.name}.at_child", zero)
        return model.frames[self.joint.child].rotation @ along

    def turned(self, at: Posed, q: ca.SX, goal: ca.SX) -> ca.SX:
        """q with this arm in the direction of `goal`; the angle stays within half a turn of its
        value in q."""
        model = at(q)
        arm, i = self.vector(model), model.coordinate(self.joint.name)
        after = ca.SX(q)
        after[i] = q[i] + ca.atan2(_cross(arm, goal), ca.dot(arm, goal))
        return after


@dataclass(frozen=True)
class ThreePivots:
    """A dyad with three revolute joints: `second` turns about a known pivot, or is carried by the
    first link and reaches for the known point `target` (body, parameter)."""

    first: Arm
    second: Arm
    target: tuple[str, str] | None

    @property
    def joints(self) -> tuple[Joint, Joint]:
        return self.first.joint, self.second.joint

    def _base(self, model: LinkageModel) -> ca.SX:
        pivot = model.twists(self.first.joint)[0]
        if self.target is None:
            return model.twists(self.second.joint)[0] - pivot
        body, at = self.target
        return model.frames[body].point(model.p[at]) - pivot

    def side(self, model: LinkageModel) -> ca.SX:
        d, arm = self._base(model), self.first.vector(model)
        return _cross(d, arm) / (ca.norm_2(d) * ca.norm_2(arm))

    def close(self, at: Posed, q: ca.SX, sigma: ca.SX) -> ca.SX:
        model = at(q)
        d, first, second = self._base(model), self.first.vector(model), self.second.vector(model)
        square, l1, l2 = ca.dot(d, d), ca.dot(first, first), ca.dot(second, second)
        a = (l1 - l2 + square) / (2 * square)
        b = ca.sqrt(l1 / square - a**2)
        X = a * d + sigma * b * ca.vertcat(-d[1], d[0])
        q = self.first.turned(at, q, X)
        return self.second.turned(at, q, X - d if self.target is None else d - X)


@dataclass(frozen=True)
class TwoPivotsAndSlide:
    """A dyad with two revolute joints and a slide: `first` turns about a known pivot, `second`
    slides along a known line."""

    first: Arm
    second: Arm

    @property
    def joints(self) -> tuple[Joint, Joint]:
        return self.first.joint, self.second.joint

    def _direction(self, model: LinkageModel) -> ca.SX:
        return model.twists(self.second.joint)[1][0][1:]

    def side(self, model: LinkageModel) -> ca.SX:
        arm = self.first.vector(model)
        return ca.dot(self._direction(model), arm) / ca.norm_2(arm)

    def close(self, at: Posed, q: ca.SX, sigma: ca.SX) -> ca.SX:
        model = at(q)
        point = model.frames[self.second.joint.child].point(model.p[self.second.end])
        d, e = point - model.twists(self.first.joint)[0], self._direction(model)
        arm, along = self.first.vector(model), ca.dot(e, d)
        s = -along + sigma * ca.sqrt(ca.dot(arm, arm) - ca.dot(d, d) + along**2)
        i = model.coordinate(self.second.joint.name)
        q = ca.SX(q)
        q[i] = q[i] + s
        return self.first.turned(at, q, d + e * s)


def _cross(a: ca.SX, b: ca.SX) -> ca.SX:
    return a[0] * b[1] - a[1] * b[0]
