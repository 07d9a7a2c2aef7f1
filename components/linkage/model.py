"""Kinematics and Lagrangian terms of a linkage, by differentiation of the kinematics.

q are relative joint coordinates of the tree; loops are closed by the constraints h(q) = 0 (2.13),
closures.py. The linkage is in the plane, d = 2, or in space, d = 3; all else is the same.
The terms of (2.3), D qdd + C qd + g = J_h' F_h + W' lambda:

    D   = sum_i m_i J_i' J_i + I_i J_theta,i' J_theta,i       (2.7), (2.10)
    C qd = J' M Jdot qd of all bodies, stacked                (2.11) contracted with qd
    W   = dh/dq,   w = Wdot qd                                (2.14), (3.2) as corrected
    J_h = d x_h/dq                                            (2.18)

A body that turns about one axis of the world has an angle, in the plane as in space. Of another
one, J_theta,i are the nine rates of its rotation matrix R = (r_1 r_2 r_3), with the constant

    E = tr(I)/2 1 - I,   T = 1/2 tr(Rdot E Rdot') = 1/2 omega' (R I R') omega

in the place of I, so that M is constant here, too. An E_jk (j < k) is the weight of r_j + r_k, and
is taken off those of r_j and r_k: M is diagonal.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from itertools import combinations

import casadi as ca

from hapticlink.components.component import Signals
from hapticlink.components.linkage.closures import Closure, closures, gear_parameters
from hapticlink.components.linkage.frame import Frame
from hapticlink.components.linkage.parameters import body_parameters
from hapticlink.components.linkage.rotations import (
    SIZE,
    Z_AXIS,
    Axis,
    of_ball,
    rates_of_ball,
    shorten,
    unit,
)
from hapticlink.components.specs.joint_types import Freedom
from hapticlink.components.specs.linkage import Joint, Linkage


class LinkageModel:
    """The terms of (2.3) at q and qd, each built when it is first used.

    q, qd: n x 1. p: the parameters by name. D is n x n, W is m x n, J_h is 3 x n; places and
    velocities in the world are d x 1. tabled: (y, y')
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
        self.d = linkage.dimension

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
        frames = {"ground": Frame.world(self.d)}
        for j in self.outward:
            frames[j.child] = self._child(j, frames[j.parent])
        return frames

    def lifted(self, vector: ca.SX) -> ca.SX:
        """A vector of a parameter as d x 1: a third number that it does not have is absent, and
        takes no operations."""
        return vector if vector.numel() == self.d else ca.vertcat(vector, ca.SX(1, 1))

    def place(self, name: str) -> ca.SX | None:
        """The point of a body that a parameter gives (d x 1), if there is one."""
        return self.lifted(self.p[name]) if name in self.p else None

    def at(self, body: str, point: str) -> ca.SX:
        """World position of the point of a body that a parameter gives, or of its origin."""
        return self.frames[body].point(self.place(point))

    def _of(self, joint: Joint) -> ca.SX:
        k = self.coordinate(joint.name)
        return self.q[k : k + joint.kind.size]

    def along(self, name: str, axis: object) -> ca.SX:
        """The direction (d x 1) of a slide along the `axis` of a joint or cut joint: in the plane
        by its angle from the x axis, a parameter; in space numbers."""
        if self.d > 2:
            direction = axis if isinstance(axis, tuple) else Z_AXIS
            return ca.SX(ca.sparsify(ca.DM(unit(direction))))
        angle = self.p[f"{name}.axis"]
        return ca.vertcat(ca.cos(angle), ca.sin(angle))

    def _guided(self, joint: Joint, parent: Frame) -> tuple[ca.SX, ca.SX]:
        """World position of the joint's point after its slides (m), and the directions of these, a
        column each."""
        q, guided = self._of(joint), list[tuple[ca.SX, ca.SX]]()
        for i, freedom in enumerate(joint.kind.freedoms):
            if isinstance(freedom.along, tuple):
                guided.append((q[i], ca.SX(ca.DM(freedom.along))))
            elif freedom.along:
                guided.append((q[i], self.along(joint.name, joint.axis)))
        pivot = parent.point(self.place(f"{joint.name}.at_parent"))
        if not guided:
            return pivot, ca.SX(self.d, 0)
        along = parent.rotation @ ca.horzcat(*(direction for _, direction in guided))
        return pivot + along @ ca.vertcat(*(slide for slide, _ in guided)), along

    def _turned(self, joint: Joint, frame: Frame) -> Iterator[tuple[Frame, ca.SX]]:
        """The parent's frame after each turn of a joint, and that turn's omega for a unit rate (1 x
        1 in the plane, d x 1 in space); a ball turns at once, by three of them."""
        q = self._of(joint)
        for i, freedom in enumerate(joint.kind.freedoms):
            if freedom.turns and freedom.about != "ball":
                axis = turn_axis(joint, freedom)
                frame = frame.turned(axis, q[i])
                yield frame, ca.SX(1) if self.d == 2 else frame.direction(axis)
            elif i in joint.kind.balls:
                ball, rotation = q[i : i + SIZE], frame.rotation
                frame = frame.rotated(of_ball(ball))
                for omega in ca.horzsplit(rotation @ rates_of_ball(ball)):
                    yield frame, omega

    def twists(self, joint: Joint) -> tuple[ca.SX, list[ca.SX]]:
        """The joint's point in the world (m), and the twist (omega, v) there for a unit rate of
        each of its coordinates: (omega, v_x, v_y) in the plane, six entries in space."""
        parent = self.frames[joint.parent]
        pivot, along = self._guided(joint, parent)
        slides, turned = iter(ca.horzsplit(along)), self._turned(joint, parent)
        still = ca.SX(1 if self.d == 2 else self.d, 1)
        return pivot, [
            ca.vertcat(
                next(turned)[1] if freedom.turns else still,
                next(slides) if freedom.slides else ca.SX(self.d, 1),
            )
            for freedom in joint.kind.freedoms
        ]

    def _child(self, joint: Joint, parent: Frame) -> Frame:
        pivot, _ = self._guided(joint, parent)
        *_, turned = parent, *(frame for frame, _ in self._turned(joint, parent))
        child, back = turned.at(pivot), self.place(f"{joint.name}.at_child")
        return child if back is None else child.moved(pivot - child.rotation @ back)

    @cached_property
    def balls(self) -> list[int]:
        """The first coordinate of each ball."""
        return [
            self.coordinate(joint.name) + i
            for joint in self.linkage.joint
            for i in joint.kind.balls
        ]

    def shortened(self, q: ca.SX, qd: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Coordinates and rates with each ball by the shorter of its vectors (rotations.py)."""
        return shorten(q, qd, self.balls) if self.balls else (q, qd)

    def rate(self, r: ca.SX) -> ca.SX:
        """Time derivative (dr/dq) qd of an expression r in q."""
        return ca.jtimes(r, self.q, self.qd)

    @cached_property
    def centers(self) -> dict[str, ca.SX]:
        """World position of every body's centre of mass, m."""
        return {b.name: self.at(b.name, f"{b.name}.center") for b in self.linkage.body}

    def inertia(self, body: str) -> ca.SX:
        """The inertia of a body about its centre of mass (kg.m2), in its own axes: 1 x 1 where it
        is the same about every axis and in the plane, else 3 x 3."""
        entries = self.p[f"{body}.inertia"]
        if entries.numel() == 1:
            return entries
        matrix = ca.diag(entries[:3])
        for k, (i, j) in enumerate(combinations(range(3), 2), 3):
            if k < entries.numel():
                matrix[i, j] = matrix[j, i] = entries[k]
        return matrix

    def inertia_about(self, body: str, axis: Axis) -> ca.SX:
        """That about an axis of its own."""
        inertia, a = self.inertia(body), ca.SX(ca.sparsify(ca.DM(axis)))
        return inertia if inertia.numel() == 1 else a.T @ inertia @ a

    @cached_property
    def bodies(self) -> dict[str, tuple[ca.SX, ca.SX]]:
        """By body: the pose of its centre of mass, with its angle (x, y, theta in the plane) or
        entries of its rotation matrix, and their weights (m, m, I), a column each."""
        return {b.name: self._weighted(b.name) for b in self.linkage.body}

    def _weighted(self, body: str) -> tuple[ca.SX, ca.SX]:
        frame, mass = self.frames[body], self.p[f"{body}.mass"]
        poses, weights = [self.centers[body]], [mass] * self.d
        if frame.fixed_axis:
            return ca.vertcat(*poses, frame.angle), ca.vertcat(
                *weights, self.inertia_about(body, frame.axis or Z_AXIS)
            )
        inertia = self.inertia(body)
        if inertia.numel() == 1:
            inertia = inertia * ca.SX.eye(3)
        E = ca.sparsify(ca.trace(inertia) / 2 * ca.SX.eye(3) - inertia)
        columns = ca.horzsplit(frame.rotation)
        own = [E[k, k] for k in range(3)]
        for j, k in combinations(range(3), 2):
            if E.sparsity().has_nz(j, k):
                poses.append(columns[j] + columns[k])
                weights += [E[j, k]] * 3
                own[j], own[k] = own[j] - E[j, k], own[k] - E[j, k]
        weights += [weight for weight in own for _ in range(3)]
        return ca.vertcat(*poses, *columns), ca.vertcat(*weights)

    @cached_property
    def _bodies(self) -> tuple[ca.SX, ca.SX]:
        """Poses of all bodies and their weights, each stacked to a column."""
        poses, weights = zip(*self.bodies.values(), strict=True)
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
        """V = J qd of all bodies' poses, 3k x 1 in the plane."""
        return self.rate(self._bodies[0])

    def momentum(self, velocities: ca.SX) -> ca.SX:
        """The generalised momentum J' M V of velocities V of all bodies, n x 1."""
        poses, weights = self._bodies
        return ca.jtimes(poses, self.q, weights * velocities, True)

    @cached_property
    def kinetic_energy(self) -> ca.SX:
        return 0.5 * ca.dot(self._bodies[1], self.velocities**2)

    @cached_property
    def closures(self) -> list[Closure]:
        return closures(self)

    @property
    def rows(self) -> tuple[int, ...]:
        """The number of rows of each closure: loops first, then gears."""
        return tuple(k for closure in self.closures if (k := closure.h.numel()))

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
        gaps = [ca.norm_2(closure.h) for closure in self.closures if closure.h.numel()]
        return ca.SX(0) if not gaps else gaps[0] if len(gaps) == 1 else ca.mmax(ca.vertcat(*gaps))

    @cached_property
    def x_h(self) -> ca.SX:
        """Pose of the operational point (2.16), (x, y, theta) in the plane."""
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
        """Pose, as the port has it, of the point of a body that a parameter gives, or of its
        origin: (x, y, theta) in the plane, (x, y, z) in space."""
        at, space = self.at(body, point), self.linkage.space
        return ca.vertcat(at, self.frames[body].angle) if any(space.turns) else ca.densify(at)

    @cached_property
    def J_h(self) -> ca.SX:
        return ca.jacobian(self.x_h, self.q)

    @cached_property
    def v_h(self) -> ca.SX:
        return self.rate(self.x_h)

    @cached_property
    def Jdot_qd(self) -> ca.SX:
        return self.rate(self.v_h)


def turn_axis(joint: Joint, freedom: Freedom) -> Axis:
    """The axis of a turn, in the frame that it turns and in the one that it turns from."""
    axis = joint.second_axis if freedom.about == "second_axis" else joint.axis
    return unit(axis) if isinstance(axis, tuple) else Z_AXIS


def same_point(first: ca.SX, second: ca.SX) -> ca.SX:
    """Whether two numbers of a linkage's choices are the same."""
    return ca.fabs(first - second) < 0.5


def count_rows(linkage: Linkage) -> int:
    """The number of rows of all closures. Raises ValueError as `LinkageModel` does."""
    if linkage.dimension == 2:
        return sum(loop.kind.rows() for loop in linkage.loop) + len(linkage.gear)
    p = Signals("p", (*body_parameters(linkage), *gear_parameters(linkage)))
    return sum(LinkageModel.symbolic(linkage, p).rows)
