"""Kinematics and Lagrangian terms of a planar linkage, by differentiation of the kinematics.

q are relative joint coordinates of the tree; loops are closed by the constraints h(q) = 0 (2.13),
closures.py.
The terms of (2.3), D qdd + C qd + g = J_h' F_h + W' lambda:

    D   = sum_i m_i J_i' J_i + I_i J_theta,i' J_theta,i       (2.7), (2.10)
    C qd = J' M Jdot qd of all bodies, stacked                (2.11) contracted with qd
    W   = dh/dq,   w = Wdot qd                                (2.14), (3.2) as corrected
    J_h = d x_h/dq                                            (2.18)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from hapticlink.components.component import Signals
from hapticlink.components.linkage.closures import Closure, closures
from hapticlink.components.specs.linkage import Joint, Linkage


@dataclass(frozen=True)
class Frame:
    """A body's frame in the world: origin (m) and angle (rad), with its cosine and sine."""

    origin: ca.SX
    angle: ca.SX
    rotation: ca.SX

    @staticmethod
    def turned(origin: ca.SX, angle: ca.SX) -> Frame:
        """The frame at an origin, turned by an angle from the world."""
        c, s = ca.cos(angle), ca.sin(angle)
        return Frame(origin, angle, ca.vertcat(ca.horzcat(c, -s), ca.horzcat(s, c)))

    def point(self, local: ca.SX | None) -> ca.SX:
        """World position of a point of the body; None is the frame's origin."""
        return self.origin if local is None else self.origin + self.rotation @ local

    def local(self, point: ca.SX) -> ca.SX:
        """Position in the body's frame of a point of the world."""
        return self.rotation.T @ (point - self.origin)


class LinkageModel:
    """The terms of (2.3) at q and qd, each built when it is first used.

    q, qd: n x 1. p: the parameters by name. D is n x n, W is m x n, J_h is 3 x n. tabled: (y, y')
    of the drives' signals at the instant t (s), deflection: those of the joints with friction, both
    NaN by default. Raises ValueError for bodies that no chain of joints connects to the ground.
    """

    def __init__(
        self,
        linkage: Linkage,
        p: Signals,
        q: ca.SX,
        qd: ca.SX,
        tabled: ca.SX | None = None,
        t: ca.SX | None = None,
        deflection: ca.SX | None = None,
        point: ca.SX | None = None,
    ) -> None:
        self.linkage, self.p, self.q, self.qd = linkage, p, q, qd
        self.tabled = ca.SX(0, 1) if tabled is None else tabled
        self.t = ca.SX(math.nan) if t is None else t
        self.deflection = ca.SX.nan(linkage.rubbing, 1) if deflection is None else deflection
        self.point = point

    @classmethod
    def symbolic(cls, linkage: Linkage, p: Signals) -> LinkageModel:
        """The model at symbols q and qd of its own."""
        n = len(linkage.coordinate_units)
        return cls(linkage, p, ca.SX.sym("q", n), ca.SX.sym("qd", n))

    @cached_property
    def _offsets(self) -> dict[str, int]:
        offsets, n = {}, 0
        for j in self.linkage.joint:
            offsets[j.name], n = n, n + j.kind.size
        return offsets

    def coordinate(self, joint: str) -> int:
        """Index in q of the (first) coordinate of a joint."""
        return self._offsets[joint]

    @cached_property
    def outward(self) -> list[Joint]:
        """The joints in an order in which the parent of each is the ground or an earlier child."""
        reached, order, waiting = {"ground"}, [], list(self.linkage.joint)
        while waiting:
            ready = [j for j in waiting if j.parent in reached]
            if not ready:
                names = ", ".join(f"`{j.name}`" for j in waiting)
                raise ValueError(f"joints {names}: no chain of joints leads to `ground`")
            order += ready
            reached |= {j.child for j in ready}
            waiting = [j for j in waiting if j not in ready]
        return order

    @cached_property
    def leaf_to_root(self) -> list[int]:
        """Indices of the coordinates, each after those of all joints farther out."""
        outward = [self.coordinate(j.name) + k for j in self.outward for k in range(j.kind.size)]
        return outward[::-1]

    @cached_property
    def frames(self) -> dict[str, Frame]:
        """World frame of every body, from the ground outward."""
        frames = {"ground": Frame.turned(ca.SX(2, 1), ca.SX(0))}
        for j in self.outward:
            frames[j.child] = self._child(j, frames[j.parent])
        return frames

    def _of(self, joint: Joint) -> ca.SX:
        k = self.coordinate(joint.name)
        return self.q[k : k + joint.kind.size]

    def _guided(self, joint: Joint, parent: Frame) -> tuple[ca.SX, ca.SX]:
        """World position of the joint's point after its slides (m), and the directions of these, a
        column each."""
        q, guided = self._of(joint), list[tuple[ca.SX, ca.SX]]()
        for i, freedom in enumerate(joint.kind.freedoms):
            if isinstance(freedom.along, tuple):
                guided.append((q[i], ca.SX(ca.DM(freedom.along))))
            elif freedom.along:
                axis = self.p[f"{joint.name}.axis"]
                guided.append((q[i], ca.vertcat(ca.cos(axis), ca.sin(axis))))
        pivot = parent.point(self.p.get(f"{joint.name}.at_parent"))
        if not guided:
            return pivot, ca.SX(2, 0)
        along = parent.rotation @ ca.horzcat(*(direction for _, direction in guided))
        return pivot + along @ ca.vertcat(*(slide for slide, _ in guided)), along

    def twists(self, joint: Joint) -> tuple[ca.SX, list[ca.SX]]:
        """The joint's point in the world (m), and the twist (omega, v_x, v_y) there for a unit rate
        of each of its coordinates."""
        pivot, along = self._guided(joint, self.frames[joint.parent])
        slides = iter(ca.horzsplit(along))
        return pivot, [
            ca.vertcat(
                ca.SX(1) if freedom.turns else ca.SX(1, 1),
                next(slides) if freedom.slides else ca.SX(2, 1),
            )
            for freedom in joint.kind.freedoms
        ]

    def _child(self, joint: Joint, parent: Frame) -> Frame:
        pivot, _ = self._guided(joint, parent)
        q, angle = self._of(joint), parent.angle
        for i, freedom in enumerate(joint.kind.freedoms):
            angle = angle + q[i] if freedom.turns else angle
        child, back = Frame.turned(pivot, angle), self.p.get(f"{joint.name}.at_child")
        if back is None:
            return child
        return Frame(pivot - child.rotation @ back, angle, child.rotation)

    def rate(self, r: ca.SX) -> ca.SX:
        """Time derivative (dr/dq) qd of an expression r in q."""
        return ca.jtimes(r, self.q, self.qd)

    @cached_property
    def centers(self) -> dict[str, ca.SX]:
        """World position of every body's centre of mass, m."""
        return {
            b.name: self.frames[b.name].point(self.p.get(f"{b.name}.center"))
            for b in self.linkage.body
        }

    @cached_property
    def _bodies(self) -> tuple[ca.SX, ca.SX]:
        """Poses (x, y, theta) of all bodies' centres of mass, and their weights (m, m, I), each
        stacked to 3k x 1."""
        poses, weights = [], []
        for b in self.linkage.body:
            mass, inertia = self.p[f"{b.name}.mass"], self.p[f"{b.name}.inertia"]
            poses += [self.centers[b.name], self.frames[b.name].angle]
            weights += [mass, mass, inertia]
        return ca.vertcat(*poses), ca.vertcat(*weights)

    @cached_property
    def D(self) -> ca.SX:
        poses, weights = self._bodies
        J = ca.jacobian(poses, self.q)
        return J.T @ ca.diag(weights) @ J

    @cached_property
    def C_qd(self) -> ca.SX:
        """Centripetal and Coriolis terms C qd, n x 1."""
        return self.momentum(self.rate(self.velocities))

    @cached_property
    def velocities(self) -> ca.SX:
        """V = J qd of all bodies' centres of mass, 3k x 1."""
        return self.rate(self._bodies[0])

    def momentum(self, velocities: ca.SX) -> ca.SX:
        """The generalised momentum J' M V of velocities V of all bodies (3k x 1), n x 1."""
        poses, weights = self._bodies
        return ca.jtimes(poses, self.q, weights * velocities, True)

    @cached_property
    def kinetic_energy(self) -> ca.SX:
        return 0.5 * ca.dot(self._bodies[1], self.velocities**2)

    @cached_property
    def closures(self) -> list[Closure]:
        return closures(self)

    @cached_property
    def h(self) -> ca.SX:
        """Rows of all closures (m), m x 1."""
        return ca.vertcat(ca.SX(0, 1), *(closure.h for closure in self.closures))

    @cached_property
    def W(self) -> ca.SX:
        return ca.jacobian(self.h, self.q)

    @cached_property
    def w(self) -> ca.SX:
        """Wdot qd (3.2), so that hddot = W qdd + w."""
        return self.rate(self.rate(self.h))

    @cached_property
    def closure_error(self) -> ca.SX:
        """Largest gap of all closures (m)."""
        gaps = [ca.norm_2(closure.h) for closure in self.closures]
        return ca.SX(0) if not gaps else gaps[0] if len(gaps) == 1 else ca.mmax(ca.vertcat(*gaps))

    @cached_property
    def x_h(self) -> ca.SX:
        """Pose (x, y, theta) of the operational point (2.16)."""
        if self.point is None:
            return self.pose(self.linkage.held.body, f"{self.linkage.held_name}.at")
        return self.pose_of_choice(self.point)

    def pose_of_choice(self, number: ca.SX) -> ca.SX:
        """Pose of the linkage's choice with that number, from 1; of 0, which holds no point, 0."""
        pose = ca.SX(self.linkage.space.size, 1)
        for k, name in enumerate(self.linkage.choices, 1):
            there = self.pose(self.linkage.points[name].body, f"{name}.at")
            pose += ca.if_else(same_point(number, ca.SX(k)), there, 0)
        return pose

    def pose(self, body: str, point: str) -> ca.SX:
        """Pose (x, y, theta) of the point of a body that a parameter gives, or of its origin."""
        frame = self.frames[body]
        return ca.vertcat(frame.point(self.p.get(point)), frame.angle)

    @cached_property
    def J_h(self) -> ca.SX:
        return ca.jacobian(self.x_h, self.q)

    @cached_property
    def v_h(self) -> ca.SX:
        return self.rate(self.x_h)

    @cached_property
    def Jdot_qd(self) -> ca.SX:
        return self.rate(self.v_h)


def same_point(first: ca.SX, second: ca.SX) -> ca.SX:
    """Whether two numbers of a linkage's choices are the same."""
    return ca.fabs(first - second) < 0.5
