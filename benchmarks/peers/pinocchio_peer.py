"""Pinocchio (PyPI `pin`): a planar linkage as a spatial tree about z, loops as contacts.

`Terms` gives Pinocchio's own D, bias forces, W, J_h and their rates for a dense solve with NumPy.
Its constraintDynamics takes each loop as a spatial point contact, whose z row is empty in the
plane, and in space two on its axis; its proximal solver copes with that. Pinocchio offers no
integrator for closed loops: what a user writes in Python is a Runge-Kutta loop around
constraintDynamics, and after each step a projection in the metric of D. A C++ program would save
the interpreter: the second method times the four calls of a step alone, the least that any program
could take, and gives no error.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.peers.comparable import Vector, axis, pinned, require_comparable, vector
from hapticlink.components.specs.linkage import Joint, Linkage

NAME = "Pinocchio"
METHODS = ("rk4, projected (Python loop)", "rk4, four calls only")
REPEATED = 1e-6
"""Of the largest singular value of W D^-1 W' in space: below it a row repeats others."""
WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def _at(point: Vector) -> pin.SE3:
    return pin.SE3(np.eye(3), point)


def _revolute(about: Vector) -> Any:
    """The quickest joint about an axis."""
    aligned = (pin.JointModelRX(), pin.JointModelRY(), pin.JointModelRZ())
    for joint, unit in zip(aligned, np.eye(3), strict=True):
        if (about == unit).all():
            return joint
    return pin.JointModelRevoluteUnaligned(about)


def _depth_first(linkage: Linkage) -> Iterator[Joint]:
    """Pinocchio numbers a subtree without gaps: crba and constraintDynamics rely on it."""
    stack = [j for j in reversed(linkage.joint) if j.parent == "ground"]
    while stack:
        joint = stack.pop()
        yield joint
        stack += [j for j in reversed(linkage.joint) if j.parent == joint.child]


class Terms:
    """D, W, J_h, biases of a linkage at (q, qd), in the order of our coordinates."""

    def __init__(self, linkage: Linkage) -> None:
        require_comparable(linkage)
        self.linkage, self.model = linkage, pin.Model()
        self.model.gravity.linear = vector(linkage.gravity)
        self._bodies: dict[str, tuple[int, pin.SE3]] = {"ground": (0, pin.SE3.Identity())}
        order: dict[str, list[int]] = {}
        for joint in _depth_first(linkage):
            parent, frame = self._bodies[joint.parent]
            placement, indices = frame * _at(vector(joint.at_parent)), []
            for k, kind in enumerate(self._kinds(joint)):
                name = f"{joint.name}.{k}"
                parent = self.model.addJoint(parent, kind, placement, name)
                placement = pin.SE3.Identity()
                indices.append(self.model.joints[parent].idx_v)
            order[joint.name] = indices
            self._bodies[joint.child] = parent, _at(-vector(joint.at_child))
            body = next(b for b in linkage.body if b.name == joint.child)
            inertia = pin.Inertia(body.mass, np.zeros(3), body.inertia_tensor)
            placement = self._bodies[joint.child][1] * _at(vector(body.center))
            self.model.appendBodyToJoint(parent, inertia, placement)
        self.order = np.array([i for j in linkage.joint for i in order[j.name]])
        op = linkage.held
        self._hand = self._frame("operational_point", op.body, vector(op.at))
        self._ends = [
            [self._frame(f"loop{i}.{k}", *end) for k, end in enumerate(ends)]
            for i, ends in enumerate(pinned(linkage))
        ]
        self.data = self.model.createData()

    @staticmethod
    def _kinds(joint: Joint) -> list:
        return [
            _revolute(axis(joint))
            if freedom.turns
            else pin.JointModelPrismaticUnaligned(*joint.direction(freedom), 0.0)
            for freedom in joint.kind.freedoms
        ]

    def _frame(self, name: str, body: str, at: Vector) -> int:
        joint, frame = self._bodies[body]
        return self.model.addFrame(
            pin.Frame(name, joint, 0, frame * _at(at), pin.FrameType.OP_FRAME)
        )

    def contacts(self) -> list[pin.RigidConstraintModel]:
        """The loops as Pinocchio's own point contacts."""
        return [
            pin.RigidConstraintModel(
                pin.ContactType.CONTACT_3D,
                self.model,
                self._bodies[a][0],
                self._bodies[a][1] * _at(at_a),
                self._bodies[b][0],
                self._bodies[b][1] * _at(at_b),
                WORLD,
            )
            for (a, at_a), (b, at_b) in pinned(self.linkage)
        ]

    def theirs(self, values: np.ndarray) -> np.ndarray:
        """Coordinates in Pinocchio's order."""
        flat = np.empty(len(self.order))
        flat[self.order] = values
        return flat

    def _jacobian(self, frame: int, rows: list[int]) -> np.ndarray:
        # One column comes back flat.
        J = pin.getFrameJacobian(self.model, self.data, frame, WORLD).reshape(6, -1)
        return J[np.array(rows)[:, None], self.order]

    def at(self, q: np.ndarray, qd: np.ndarray) -> dict[str, np.ndarray]:
        """D, nle = C qd + g, W, w = Wdot qd, h, J_h, Jdot_qd, x_h, in our order."""
        q, qd = self.theirs(q), self.theirs(qd)
        still = np.zeros_like(q)
        D = pin.crba(self.model, self.data, q)
        D = (np.triu(D) + np.triu(D, 1).T)[np.ix_(self.order, self.order)]
        nle = pin.rnea(self.model, self.data, q, qd, still)[self.order]
        pin.computeJointJacobians(self.model, self.data, q)
        pin.forwardKinematics(self.model, self.data, q, qd, still)
        pin.updateFramePlacements(self.model, self.data)

        d = self.linkage.dimension

        def bias(frame: int) -> np.ndarray:
            return pin.getFrameClassicalAcceleration(self.model, self.data, frame, WORLD).vector

        def place(frame: int) -> np.ndarray:
            return self.data.oMf[frame].translation[:d].copy()  # else it changes with the data

        def stack(parts: list, empty: tuple[int, ...]) -> np.ndarray:
            return np.concatenate(parts) if parts else np.zeros(empty)

        xy, hand = [*range(d)], [*self.linkage.space.rows]
        pairs = self._ends
        return {
            "D": D,
            "nle": nle,
            "W": stack(
                [self._jacobian(a, xy) - self._jacobian(b, xy) for a, b in pairs], (0, len(q))
            ),
            "w": stack([(bias(a) - bias(b))[xy] for a, b in pairs], (0,)),
            "h": stack([place(a) - place(b) for a, b in pairs], (0,)),
            "J_h": self._jacobian(self._hand, hand),
            "Jdot_qd": bias(self._hand)[hand],
            "x_h": place(self._hand),
        }


def prepare(
    linkage: Linkage, wrench: np.ndarray, q: np.ndarray, qd: np.ndarray, method: str, h: float
) -> Callable[[int], tuple[float, ...]]:
    terms = Terms(linkage)
    model, data = terms.model, terms.data
    contacts, contact_data = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for contact in terms.contacts():
        contacts.append(contact)
        contact_data.append(contact.createData())
    pin.initConstraintDynamics(model, data, contacts, contact_data)
    # Redundant rows that differ off the closed poses brake a loop that holds them too well.
    planar = linkage.dimension == 2
    proximal = pin.ProximalSettings(*((1e-14, 1e-10, 10) if planar else (1e-10, 1e-2, 100)))
    force = np.array([wrench[0], wrench[1], 0.0, 0.0, 0.0, wrench[2]])
    q0, v0 = terms.theirs(q), terms.theirs(qd)

    def acceleration(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        tau = np.zeros_like(v)
        if force.any():
            J = pin.computeFrameJacobian(model, data, q, terms._hand, WORLD)
            tau = J.T @ force
        return pin.constraintDynamics(model, data, q, v, tau, contacts, contact_data, proximal)

    def four_calls(steps: int) -> tuple[float, ...]:
        tau, began = np.zeros_like(v0), time.perf_counter()
        for _ in range(4 * steps):
            pin.constraintDynamics(model, data, q0, v0, tau, contacts, contact_data, proximal)
        return math.nan, math.nan, time.perf_counter() - began

    def loop(steps: int) -> tuple[float, ...]:
        q, v, began = q0.copy(), v0.copy(), time.perf_counter()
        for _ in range(steps):
            a1 = acceleration(q, v)
            v2 = v + h / 2 * a1
            a2 = acceleration(q + h / 2 * v, v2)
            v3 = v + h / 2 * a2
            a3 = acceleration(q + h / 2 * v2, v3)
            v4 = v + h * a3
            a4 = acceleration(q + h * v3, v4)
            q = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
            v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            q, v = _project(terms, q, v)
        seconds = time.perf_counter() - began
        return *terms.at(q[terms.order], v[terms.order])["x_h"].tolist(), seconds

    return four_calls if method == METHODS[1] else loop


def _project(terms: Terms, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One chord of the closures in the metric of D; lstsq for redundant ones, which off the closed
    poses of an overconstrained loop differ from what they repeat."""
    if not terms.linkage.loop:
        return q, v
    at = terms.at(q[terms.order], v[terms.order])
    Y = np.linalg.solve(at["D"], at["W"].T)
    left = np.stack([at["h"], at["W"] @ v[terms.order]], axis=1)
    least = 1e-12 if terms.linkage.dimension == 2 else REPEATED
    change = Y @ np.linalg.lstsq(at["W"] @ Y, left, rcond=least)[0]
    return q - terms.theirs(change[:, 0]), v - terms.theirs(change[:, 1])
