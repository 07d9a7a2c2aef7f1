"""The ports of a cut co-simulation by frequency, in scales in which all impedances are in N.s/m.

A system that is sampled N times in a period P answers to the frequency w with all w + 2 pi h/P. A
termination that does not change with time mixes none of them: it is a block for each harmonic h.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigvals
from scipy.optimize import minimize_scalar

from hapticlink.analysis.stability.port_response import Response
from hapticlink.orchestrator.base.arrays import Complex, Matrix

STILL = 1e-9
"""Mobility, relative to the largest, of a coordinate in which the device does not move."""
RIGID = 1e-6
"""That of a direction in which the rendering does not let the handle move."""

HELD = 1e-5
"""Mobility of the device, relative to that at a quarter of the rate, that is rounding of slopes."""
SHARP = 0.1
"""Half width w P of a resonance that a grid of frequencies can miss."""
SEARCH = 16
"""Evaluations of the search for the angle of the largest damping shortage."""


@dataclass(frozen=True)
class Hybrid:
    """v_1 = Y F_1 + there v_2, F_2 = back F_1 + own v_2 of a hand's port 1 and a mechanism's port 2
    at the frequency `angle`/P, harmonic by harmonic, r entries each; 2 may be empty."""

    Y: Complex
    there: Complex
    back: Complex
    own: Complex
    r: int

    @property
    def impedance(self) -> Complex:
        """F = Z v of both ports."""
        Z = np.linalg.inv(self.Y)
        return np.block(
            [[Z, -Z @ self.there], [self.back @ Z, self.own - self.back @ Z @ self.there]]
        )

    def harmonic(self, h: int) -> Hybrid:
        """That of one harmonic of the hand, and the one of the mechanism that it is seen as: with
        terminations that pass all other frequencies."""
        steps = len(self.own) // self.r
        i = slice(h * self.r, (h + 1) * self.r)
        j = slice((h % steps) * self.r, (h % steps + 1) * self.r) if steps else slice(0, 0)
        return Hybrid(self.Y[i, i], self.there[i, j], self.back[j, i], self.own[j, j], self.r)


class MotionScale:
    """The first `lengths` directions are translations. Rotations are scaled by the length (m) at
    which the device has as much impedance in both; `turns` is its square, 0 without rotations.
    moving: orthonormal directions in which the handle moves, `free` those of the device alone. A
    rendered constraint lets the handle move in fewer: the impedance is infinite in the others, in
    which the mechanism does not move either."""

    def __init__(self, device: Response, whole: Response, T: float, lengths: int) -> None:
        self._T, m = T, device.m
        size = np.abs(np.diag(_a_period(device)))
        moves = size > STILL * size.max()
        linear, turned = (moves & (np.arange(m) < lengths)), (moves & (np.arange(m) >= lengths))
        self._lengths = np.ones(m)
        if linear.any():
            self._lengths[turned] = np.sqrt(size[linear].mean() / size[turned])
        self.turns = float((self._lengths[turned] ** 2).sum())
        self.free = np.eye(m)[:, moves]
        scaled = self.free.T @ (self._lengths[:, None] * _a_period(whole) * self._lengths)
        parts = scaled @ self.free
        _, sizes, directions = np.linalg.svd(np.vstack([parts.real, parts.imag]))
        self.moving: Matrix = self.free @ directions[sizes > RIGID * sizes[0]].T

    def moved(self, device: Response, angle: float) -> bool:
        """Whether the device moves at an angle: at half the rate a held force that changes its sign
        every period may not, so that its impedance has no value there."""
        Y, usual = (self.at(device, at, 0.0, self.free).Y for at in (angle, np.pi / 2))
        return bool(np.linalg.norm(Y, -2) > HELD * np.linalg.norm(usual, 2))

    def resonances(self, found: Response) -> Matrix:
        """Angles w P in (0, pi), ever closer to the poles of F = Z v near the unit circle, beside
        which an impedance can peak: z of the modes with the handle held still,

            (A - z) z_0 + B u = 0,   x_{k+1} - x_k = 0
        """
        k, m, n = found.forces, found.m, len(found.A)
        along = np.kron(np.eye(k // m), self._lengths[:, None] * self.moving)
        x, dx = (
            np.hstack([found.C, found.D])[:k, : n + k],
            np.hstack([found.A, found.B])[:, : n + k],
        )
        after = np.vstack([x[m:], found.C[:m] @ dx])
        B, moved = found.B[:, :k] @ along, along.T @ (after - x)
        held = np.block([[found.A, B], [moved[:, :n], moved[:, n:] @ along]])
        mass = np.zeros_like(held)
        mass[:n, :n] = np.eye(n)
        poles = eigvals(held, mass)
        poles = poles[np.isfinite(poles) & (np.abs(poles) > 0.5) & (np.abs(poles) < 2.0)]
        angles, widths = np.abs(np.angle(poles)), np.abs(np.log(np.abs(poles)))
        sharp = (widths < SHARP) & (widths > STILL) & (angles < np.pi - SHARP)
        near = [
            at + side * width * 2.0 ** np.arange(-1, np.log2(SHARP / width))
            for at, width in zip(angles[sharp], widths[sharp], strict=True)
            for side in (-1, 1)
        ]
        all_of = np.concatenate([*near, angles[sharp]])
        return np.unique(all_of[(all_of > STILL) & (all_of < np.pi)].round(9))

    def at(self, found: Response, angle: float, H: float, along: Matrix) -> Hybrid:
        """A response at z' = exp(i angle) z, with steps H (s) of the mechanism. Velocities are
        means over the steps, and enter as displacements by the square root of their length, so
        that Re F*v is the power."""
        G, k, m = found.at(angle), found.forces, found.m
        N, n = k // m, (len(G) - k) // m
        S = np.concatenate(
            [np.tile(self._lengths / np.sqrt(self._T), N), np.tile(np.sqrt(H) / self._lengths, n)]
        )
        G = S[:, None] * G * S
        one, two = (np.kron(_waves(angle, count), along) for count in (N, n))
        left = one.conj().T, two.conj().T
        return Hybrid(
            left[0] @ G[:k, :k] @ one,
            left[0] @ G[:k, k:] @ two,
            left[1] @ G[k:, :k] @ one,
            left[1] @ G[k:, k:] @ two,
            along.shape[1],
        )


def with_worst(angles: Matrix, shortage: Callable[[float], float]) -> Matrix:
    """The angles, and beside the one at which the `shortage` is largest the one where it peaks,
    unless it is the last one."""
    worst = int(np.argmax([shortage(angle) for angle in angles]))
    if worst == len(angles) - 1:
        return angles
    bounds = angles[max(worst - 1, 0)], angles[min(worst + 1, len(angles) - 1)]
    options = {"maxiter": SEARCH, "xatol": 1e-9}
    found = minimize_scalar(
        lambda a: -shortage(a), bounds=bounds, method="bounded", options=options
    )
    return np.union1d(angles, [float(found.x)])


def hertz(angle: float, h: int, N: int, period: float) -> float:
    """The frequency (Hz) of the harmonic h of N samples, at most half their rate."""
    turns = (angle / (2 * np.pi) + h) / N
    return float(min(turns, 1.0 - turns) * N / period)


def _waves(angle: float, count: int) -> Complex:
    """The harmonics of a signal of `count` samples in a period, as orthonormal columns."""
    k = np.arange(count)
    waves = np.exp(1j * np.outer(k, (angle + 2 * np.pi * k) / max(count, 1)))
    return waves / np.sqrt(max(count, 1))


def _a_period(found: Response) -> Complex:
    """The displacement of the handle over a period by the force of that period, summed over all."""
    G, m = found.at(np.pi / 2), found.m
    return np.add.reduce([G[i : i + m, i : i + m] for i in range(0, found.forces, m)], axis=0)
