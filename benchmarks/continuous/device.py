"""A device of pins in absolute coordinates: all its bodies, and its motors.

With the handle's rows of G moved to the right, G_p zd_p = -G_h v gives the velocities zd = N v of
all bodies, and with them

    M_d = N' m N,   c = N' m (Ndot v),   J_q: the rates of the motors' joints

The bodies are led to a pose of the handle by Newton's method, from the pose before it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.maximal import Maximal, turned
from hapticlink.components.device.models import device_model
from hapticlink.components.device.workspace import margin
from hapticlink.components.linkage.poses import poses
from hapticlink.components.specs.device import Device

CLOSED, STEPS = 1e-14, 50
"""Gap (m) of the pins, and steps of Newton's method."""


class AbsoluteDevice:
    """The device, without its stops, whose handle is held in the middle of its body; raises
    ValueError at a pose within the stops."""

    def __init__(self, spec: Device) -> None:
        self._spec, names = spec, [body.name for body in spec.body]
        self._handle = names.index(spec.handle.body)
        centers = {body.name: np.array(body.center or (0.0, 0.0)) for body in spec.body}

        def end(body: str, at: Any) -> tuple[int, tuple[float, float]]:
            x, y = np.array(at or (0.0, 0.0)) - centers.get(body, 0.0)
            return (names.index(body) if body in names else -1), (float(x), float(y))

        joined: list[Any] = [((j.parent, j.at_parent), (j.child, j.at_child)) for j in spec.placed]
        joined += [tuple(zip(c.bodies, c.at, strict=True)) for c in spec.placed_loops]
        self._pins = [(end(*one), end(*other)) for one, other in joined]
        mass = np.array([[body.mass, body.mass, body.inertia] for body in spec.body])
        for motor in spec.motors:
            if motor.joint.parent != "ground":
                raise ValueError("the reference knows motors on the ground alone")
            mass[names.index(motor.joint.child), 2] += motor.inertia
        self._driven = [3 * names.index(motor.joint.child) + 2 for motor in spec.motors]
        self._joined = Maximal(mass, self._pins)
        start = poses(spec.linkage, [device_model(spec).start.tolist()])
        z = [start[name][0] for name in names]
        self._z = np.array(
            [
                [*(pose[:2] + turned(pose[2], centers[name])), pose[2]]
                for name, pose in zip(names, z, strict=True)
            ]
        ).ravel()

    def motion(self, pose: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
        """M_d (3, 3), c (3,) and J_q (m, 3) at a pose and velocity of the handle."""
        z, (held, others) = self._placed(pose), self._rows()
        N = np.zeros((len(z), 3))
        N[held] = np.eye(3)
        G, _ = self._joined.closures(z, np.zeros(len(z)))
        N[others] = np.linalg.solve(G[:, others], -G[:, held])
        _, gamma = self._joined.closures(z, N @ v)
        bias = np.zeros(len(z))
        bias[others] = np.linalg.solve(G[:, others], gamma)
        weighted = N.T * self._joined.mass
        return weighted @ N, weighted @ bias, N[self._driven]

    def torques(self, J_q: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Motor torques (N.m, m) of least norm, scaled to the limits."""
        tau = np.linalg.lstsq(J_q.T, wrench, rcond=None)[0]
        limits = np.array([motor.torque_limit for motor in self._spec.motors])
        return tau / max(1.0, np.abs(tau / limits).max())

    def _rows(self) -> tuple[np.ndarray, np.ndarray]:
        """The entries of z of the handle's body, and the others."""
        held = 3 * self._handle + np.arange(3)
        return held, np.setdiff1d(np.arange(len(self._z)), held)

    def _placed(self, pose: np.ndarray) -> np.ndarray:
        """All centres of mass and angles."""
        if margin(self._spec, pose[None])[0] < 0.0:
            raise ValueError(f"the device meets its stops at {pose}, which the reference lacks")
        z, (held, others) = self._z.copy(), self._rows()
        z[held] = pose
        for _ in range(STEPS):
            gap = self._gap(z)
            if np.abs(gap).max() < CLOSED:
                break
            G, _ = self._joined.closures(z, np.zeros(len(z)))
            z[others] -= np.linalg.solve(G[:, others], gap)
        self._z = z
        return z

    def _gap(self, z: np.ndarray) -> np.ndarray:
        def place(end: tuple[int, tuple[float, float]]) -> np.ndarray:
            body, at = end
            if body < 0:
                return np.array(at)
            x = z[3 * body : 3 * body + 3]
            found: np.ndarray = x[:2] + turned(x[2], np.array(at))
            return found

        return np.concatenate([place(one) - place(other) for one, other in self._pins])
