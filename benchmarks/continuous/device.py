"""The twin pantograph in absolute coordinates: nine bodies, pins and motors.

With the handle's rows of G moved to the right, G_p zd_p = -G_h v gives the velocities zd = N v of
all bodies, and with them

    M_d = N' m N,   c = N' m (Ndot v),   J_q: the rows of N of the links next to the motors
"""

from __future__ import annotations

import numpy as np

from benchmarks.maximal import Maximal
from hapticlink.components.specs.device import Device


class Pantograph:
    """The device, without its stops; raises ValueError at a pose within them."""

    def __init__(self, spec: Device) -> None:
        self._spec = d = spec
        sides, planes = (-1, 1), ((d.base_y_a, -1.0), (d.base_y_b, 1.0))
        self._bases = np.array(
            [[d.base_x + s * d.base_half_width, y] for y, _ in planes for s in sides]
        )
        self._outward = np.array([s for _ in planes for s in sides], float)
        self._ends = np.array([[e * d.crank / 2, 0.0] for _, e in planes for _ in sides])
        proximal = [d.proximal_mass] * 2 + [d.proximal_inertia + d.rotor_inertia]
        distal = [d.distal_mass] * 2 + [d.distal_inertia]
        handle = [d.handle_mass] * 2 + [d.handle_inertia]
        pins = []
        for k, (base, end) in enumerate(zip(self._bases, self._ends, strict=True)):
            near, far = 2 * k, 2 * k + 1
            pins += [
                ((-1, tuple(base)), (near, (-d.proximal_center, 0.0))),
                (
                    (near, (d.proximal_length - d.proximal_center, 0.0)),
                    (far, (-d.distal_center, 0.0)),
                ),
                ((far, (d.distal_length - d.distal_center, 0.0)), (8, tuple(end))),
            ]
        self._joined = Maximal(np.array([*[proximal, distal] * 4, handle]), pins)
        longest = d.proximal_length + d.distal_length
        spare = (1 - d.reach_limit) * longest
        self._reach = abs(d.proximal_length - d.distal_length) + spare, longest - spare

    def motion(self, pose: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
        """M_d (3, 3), c (3,) and J_q (4, 3) at a pose and velocity of the handle."""
        z = self._placed(pose)
        N = np.zeros((27, 3))
        N[24:] = np.eye(3)
        G, _ = self._joined.closures(z, np.zeros(27))
        N[:24] = np.linalg.solve(G[:, :24], -G[:, 24:])
        _, gamma = self._joined.closures(z, N @ v)
        bias = np.zeros(27)
        bias[:24] = np.linalg.solve(G[:, :24], gamma)
        weighted = N.T * self._joined.mass
        return weighted @ N, weighted @ bias, N[2:24:6]

    def torques(self, J_q: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Motor torques (N.m, 4) of least norm, scaled to the limit."""
        tau = np.linalg.lstsq(J_q.T, wrench, rcond=None)[0]
        return tau * (self._spec.torque_limit / max(self._spec.torque_limit, np.abs(tau).max()))

    def _placed(self, pose: np.ndarray) -> np.ndarray:
        """All centres of mass and angles, elbows outward."""
        d = self._spec
        c, s = np.cos(pose[2]), np.sin(pose[2])
        ends = pose[:2] + self._ends @ np.array([[c, s], [-s, c]])
        span = ends - self._bases
        reach = np.linalg.norm(span, axis=1)
        if (reach < self._reach[0]).any() or (reach > self._reach[1]).any():
            raise ValueError(f"the device meets its stops at {pose}, which the reference lacks")
        along = (reach**2 + d.proximal_length**2 - d.distal_length**2) / (2 * reach)
        aside = np.sqrt(d.proximal_length**2 - along**2)
        u = span / reach[:, None]
        n = np.column_stack([-u[:, 1], u[:, 0]])
        n *= np.sign(self._outward * n[:, 0])[:, None]  # the elbow lies outward of base and end
        elbow = along[:, None] * u + aside[:, None] * n
        z = np.zeros((9, 3))
        for rows, start, way, center in (
            (slice(0, 8, 2), self._bases, elbow, d.proximal_center / d.proximal_length),
            (slice(1, 8, 2), self._bases + elbow, span - elbow, d.distal_center / d.distal_length),
        ):
            z[rows, :2] = start + center * way
            z[rows, 2] = np.arctan2(way[:, 1], way[:, 0])
        z[8] = pose
        return z.ravel()
