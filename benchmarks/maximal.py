"""Bodies in absolute coordinates (x, y, theta of each centre of mass), joined by pins.

    G(z) zd = 0,   M zdd = Q + G' lambda,   G zdd = gamma(z, zd)

Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems I (1989), chapters 3 and 6.
Written in NumPy by hand; shares nothing with the components but a scene's numbers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.quantities import Place, in_plane

End = tuple[int, tuple[float, float]]
"""A body, -1 for the ground, and a point on it from its centre of mass (m), of the ground from the
origin."""


class Maximal:
    """Bodies of `mass` (n, 3), (kg, kg, kg.m2), and pins, each between two ends. Redundant pins and
    singular poses are allowed: multipliers are those of least norm."""

    def __init__(self, mass: np.ndarray, pins: Sequence[tuple[End, End]]) -> None:
        self.mass, self.n = np.asarray(mass, float).ravel(), 3 * len(mass)
        ends = [
            (2 * k, sign, *end)
            for k, pin in enumerate(pins)
            for sign, end in zip((1, -1), pin, strict=True)
        ]
        ends = [e for e in ends if e[2] >= 0]
        self.rows = 2 * len(pins)
        self._row = np.array([e[0] for e in ends])
        self._sign = np.array([e[1] for e in ends], float)
        self._body = np.array([e[2] for e in ends])
        self._at = np.array([e[3] for e in ends], float)

    def closures(self, z: np.ndarray, zd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """G and gamma of the pins."""
        G, gamma = np.zeros((self.rows, self.n)), np.zeros(self.rows)
        first, sign = 3 * self._body, self._sign
        r = turned(z[first + 2], self._at)
        for axis in (0, 1):
            G[self._row + axis, first + axis] = sign
        G[self._row, first + 2] = -sign * r[:, 1]
        G[self._row + 1, first + 2] = sign * r[:, 0]
        pull = (sign * zd[first + 2] ** 2)[:, None] * r
        np.add.at(gamma, self._row, pull[:, 0])
        np.add.at(gamma, self._row + 1, pull[:, 1])
        return G, gamma

    def point(self, z: np.ndarray, zd: np.ndarray, end: End) -> tuple[np.ndarray, ...]:
        """Pose (3,), its Jacobian (3, 3n) and its acceleration at zdd = 0 of a point of a body."""
        body, at = end
        i = 3 * body
        r = turned(z[i + 2], np.array(at))
        J = np.zeros((3, self.n))
        J[:, i : i + 3] = [[1, 0, -r[1]], [0, 1, r[0]], [0, 0, 1]]
        pose = np.r_[z[i : i + 2] + r, z[i + 2]]
        return pose, J, np.r_[-(zd[i + 2] ** 2) * r, 0.0]

    def accelerations(self, G: np.ndarray, gamma: np.ndarray, Q: np.ndarray) -> np.ndarray:
        """zdd (3n, k) under forces Q (3n, k), with the columns gamma (2m, k)."""
        free = Q / self.mass[:, None]
        weighted = G / self.mass
        multipliers = np.linalg.lstsq(weighted @ G.T, gamma - G @ free, rcond=1e-13)[0]
        return free + weighted.T @ multipliers


def turned(angle: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Points (..., 2) turned by an angle (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * at[..., 0] - s * at[..., 1], s * at[..., 0] + c * at[..., 1]], axis=-1)


class Bodies:
    """A linkage of revolute joints in absolute coordinates; `mechanism` has its pins, `tip` is its
    operational point. Raises ValueError for another joint, and for forces of its own except for
    weight."""

    def __init__(self, linkage: Linkage) -> None:
        kinds = {*(j.type for j in linkage.joint), *(loop.type for loop in linkage.loop)}
        if kinds != {"revolute"} or linkage.spring:
            raise ValueError("the reference knows revolute joints, and no springs")
        self.linkage = linkage
        self._place = {b.name: i for i, b in enumerate(linkage.body)}
        self._center = {b.name: np.array(b.center or (0.0, 0.0)) for b in linkage.body}
        pins = [
            (self.end(j.parent, j.at_parent), self.end(j.child, j.at_child)) for j in linkage.joint
        ]
        pins += [
            (self.end(loop.bodies[0], loop.at[0]), self.end(loop.bodies[1], loop.at[1]))
            for loop in linkage.loop
        ]
        mass = np.array([[b.mass, b.mass, b.inertia] for b in linkage.body])
        self.mechanism = Maximal(mass, pins)
        op = linkage.held
        self.tip = self.end(op.body, op.at)
        self.weight = mass * (*(linkage.gravity or (0.0, 0.0)), 0.0)

    def end(self, body: str, at: Place | None) -> End:
        """A point of a body, given in its frame."""
        point = np.array(in_plane(at)) - self._center.get(body, np.zeros(2))
        return self._place.get(body, -1), (float(point[0]), float(point[1]))

    def start(self, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """z and zd at joint coordinates q (rad) and rates qd (rad/s)."""
        frames = {"ground": (np.zeros(2), 0.0, np.zeros(2), 0.0)}

        def moved(frame: tuple, at: Place | None) -> tuple[np.ndarray, np.ndarray]:
            r = turned(frame[1], np.array(in_plane(at)))
            return frame[0] + r, frame[2] + frame[3] * np.array([-r[1], r[0]])

        waiting = list(zip(self.linkage.joint, q, qd, strict=True))
        while waiting:
            joint, value, rate = next(w for w in waiting if w[0].parent in frames)
            waiting.remove((joint, value, rate))
            parent = frames[joint.parent]
            pivot, drift = moved(parent, joint.at_parent)
            angle, omega = parent[1] + value, parent[3] + rate
            x, y = in_plane(joint.at_child)
            origin, velocity = moved((pivot, angle, drift, omega), (-x, -y))
            frames[joint.child] = (origin, angle, velocity, omega)
        z, zd = [], []
        for b in self.linkage.body:
            at, velocity = moved(frames[b.name], b.center)
            z += [*at, frames[b.name][1]]
            zd += [*velocity, frames[b.name][3]]
        return np.array(z), np.array(zd)
