"""The closed loop as one differential equation, written by hand in absolute coordinates.

State y = (z, zd, x_D, v_D), and (x_a, v_a) of an arm: the mechanism's bodies in absolute
coordinates with a multiplier for every pin, the device's links likewise at each pose of its handle
(device.py), contacts from distances (touching.py), projectors by an eigenvalue decomposition. Only
numbers of the scene and the assembled start are shared with the components.

    zdd = A_1 (F_h - F_drift) + A_c + A_0,   [Lambda^-1, a_c, a_bias - Jdot zd] = J [A_1, A_c, A_0]
    u   = M (Lambda^-1 (F_h + F_drift) + a_c + a_bias) + c - F_h + F_T

with a_c = Lambda^-1 F_env the acceleration by contacts, if they are felt, and a_bias, if it is
sent.
"""

from __future__ import annotations

import numpy as np

from benchmarks.continuous.device import AbsoluteDevice
from benchmarks.continuous.hand import Hand
from benchmarks.continuous.march import Guards
from benchmarks.continuous.touching import Touching
from benchmarks.maximal import Bodies
from hapticlink.components.specs.control import Topology
from hapticlink.orchestrator.scene.scene import Scene


def _column(*values: float) -> np.ndarray:
    return np.array(values)


class Absolute:
    """The loop of a scene, started at joint coordinates q (rad) and rates qd (rad/s), with the
    first number of constrained directions. Raises ValueError for what it does not know."""

    def __init__(self, scene: Scene, q: np.ndarray, qd: np.ndarray, first_mode: int) -> None:
        law, linkage = scene.controller, scene.linkage
        assert law
        assert linkage
        assert scene.device
        self.hand, self.first_mode = Hand(scene.hand), first_mode
        self._bodies, self._device = Bodies(linkage), AbsoluteDevice(scene.device)
        self._touching = Touching(linkage, scene.contacts, self._bodies)
        self._n = self._bodies.mechanism.n
        self._K, self._B = (
            np.array(getattr(law.teleoperation, k)) for k in ("stiffness", "damping")
        )
        self._topology = Topology() if law.topology is True else law.topology
        self._felt, self._sent = law.contact, law.bias == "full"
        self.guards = Guards(scene, self.mobility)
        z, zd = self._bodies.start(q, qd)
        pose = self._bodies.mechanism.point(z, zd, self._bodies.tip)[0]
        self.start = np.r_[z, zd, pose, np.zeros(3), self.hand.start(pose)]
        self.handle = slice(2 * self._n, 2 * self._n + 2)

    def rate(self, t: float, y: np.ndarray, mode: int) -> np.ndarray:
        """y' at time t (s)."""
        n = self._n
        z, zd, x_D, v_D, arm = np.split(y, [n, 2 * n, 2 * n + 3, 2 * n + 6])
        F_hand, moved = self.hand.rates(arm, x_D, v_D, self.hand.target(t), _column)
        x_S, J, drift, A = self._response(z, zd)
        seen = J @ A
        e, rate = x_S - x_D, J @ zd - v_D
        F_drift = self._K * e + self._B * rate
        zdd = A[:, :3] @ (F_hand - F_drift) + A[:, 3] + A[:, 4]
        a = seen[:, :3] @ (F_hand + F_drift)
        a += self._felt * seen[:, 3] + self._sent * (seen[:, 4] + drift)
        M, c, J_q = self._device.motion(x_D, v_D)
        motors = M @ a + c - F_hand + self._constraint(seen[:, :3], M, e, rate, mode)
        wrench = J_q.T @ self._device.torques(J_q, motors) + F_hand - c
        return np.concatenate([zd, zdd, v_D, np.linalg.solve(M, wrench), *moved])

    def mobility(self, y: np.ndarray) -> np.ndarray:
        """Lambda^-1, (3, 3)."""
        z, zd = y[: self._n], y[self._n : 2 * self._n]
        _, J, _, A = self._response(z, zd)
        return J @ A[:, :3]

    def _response(self, z: np.ndarray, zd: np.ndarray) -> tuple[np.ndarray, ...]:
        """x_S, J, Jdot zd, and the accelerations by unit wrenches, contacts, and the rest."""
        joined = self._bodies.mechanism
        x_S, J, drift = joined.point(z, zd, self._bodies.tip)
        G, gamma = joined.closures(z, zd)
        forces = np.column_stack([J.T, self._touching.forces(z, zd), self._bodies.weight.ravel()])
        right = np.zeros((len(gamma), 5))
        right[:, 4] = gamma
        return x_S, J, drift, joined.accelerations(G, right, forces)

    def _constraint(
        self, mobility: np.ndarray, M: np.ndarray, e: np.ndarray, rate: np.ndarray, mode: int
    ) -> np.ndarray:
        """F_T = S (P_c M_s^-1 P_c)^+ S (k_j e + b_j e')."""
        if not self._topology:
            return np.zeros(3)
        s = self.guards.scale
        _, vectors = np.linalg.eigh(s[:, None] * mobility * s)
        V = vectors[:, :mode]
        inside = V.T @ (s[:, None] * np.linalg.inv(M) * s) @ V
        pull = self._topology.stiffness * e + self._topology.damping * rate
        return s * (V @ np.linalg.solve(inside, V.T @ (s * pull)))
