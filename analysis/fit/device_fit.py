"""The parameters of a device from a log: output errors over short windows.

In window w of N samples the device's own equations (components/blocks/haptic_device.py) are stepped
from a state s_w under the logged wrenches, and

    min over theta and all s_w of  sum |q(x_k(theta, s_w)) - q(x_k)|^2 / delta^2

is solved, with q the base angles at the encoders and delta their resolution (multiple shooting:
Bock, Springer Series in Chemical Physics 18 (1981), 102). Windows are short, so that it converges
from parameters that are far off, and the free states take up what a longer one would amplify.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import block_diag, csr_array, hstack

from hapticlink.analysis.fit.estimate import FROM_ZERO, Estimate, standard_deviations
from hapticlink.analysis.fit.log import Log
from hapticlink.components.blocks.haptic_device import haptic_device
from hapticlink.components.device import pantograph
from hapticlink.components.device.motors_and_encoders import numbers
from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.errors import InputFault

FITTED = ("handle_mass", "handle_inertia", "motor_damping", "motor_friction")
"""What a log of any motion determines; masses of links act like those at handle and rotors."""
WINDOW = 0.2
"""Length of a window (s)."""


def fit_device(
    log: Log, device: Device, names: Sequence[str] = FITTED
) -> tuple[list[Estimate], float]:
    """Estimates of parameters of [device] by their names, from `device` on, and the root mean
    square of the remaining errors in encoder counts (0.29 where only counting is left).

    Raises InputFault for unknown names, and for a log that does not have the motors' wrench or does
    not move the handle.
    """
    ending = ("mass", "center", "inertia", "damping", "friction")
    known = [f.name for f in fields(device) if f.name.endswith(ending) and "stop" not in f.name]
    if unknown := [name for name in names if name not in known]:
        raise InputFault(f"device: {unknown[0]!r} cannot be fitted; {', '.join(known)} can")
    if log.motors is None:
        raise InputFault("device: the log has no wrench of the motors")
    assumed = {name: float(getattr(device, name)) for name in names}
    if np.ptp(log.pose, axis=0).max() < 10 * device.encoder_resolution * device.proximal_length:
        raise InputFault("device: the log does not move the handle by more than a few counts")
    begin: dict[str, Any] = {name: value or FROM_ZERO for name, value in assumed.items()}
    shooting = _Shooting(log, replace(device, **begin), names)
    scale, states = np.array([*begin.values()]), shooting.first_states()

    def unknowns(x: Vector) -> tuple[Vector, Matrix]:
        return x[: len(scale)] * scale, x[len(scale) :].reshape(states.shape)

    lowest = np.r_[np.full(len(scale), 1e-6), np.full(states.size, -np.inf)]
    found = least_squares(
        lambda x: shooting.errors(*unknowns(x)),
        np.r_[np.ones(len(scale)), states.ravel()],
        lambda x: shooting.slopes(*unknowns(x), scale),
        bounds=(lowest, np.inf),
        x_scale="jac",
        tr_solver="lsmr",
        xtol=1e-10,
    )
    all_scales = np.r_[scale, np.ones(states.size)]
    spread = standard_deviations(found.jac, found.fun, len(states), len(scale)) * all_scales
    units = {v.name: str(v.unit) for v in shooting.component.parameters}
    estimates = [
        Estimate(f"device.{name}", units[name], float(value), float(sd), assumed[name])
        for name, value, sd in zip(names, found.x * all_scales, spread, strict=False)
    ]
    return estimates, float(np.sqrt(np.mean(found.fun**2)))


class _Shooting:
    """Errors of the base angles in counts, and their slopes, by window."""

    def __init__(self, log: Log, device: Device, names: Sequence[str]) -> None:
        self.component = component = haptic_device(device)
        n = max(int(WINDOW / log.period), 16)
        self._windows = [*pairwise(range(0, len(log.pose), n))]
        self._log, self._n = log, n
        values = numbers(device)
        pose, state = ca.SX.sym("pose", 3), ca.SX.sym("state", 6)
        theta, u = ca.SX.sym("theta", len(names)), ca.SX.sym("u", 6)
        p = ca.SX(ca.DM([*component.start_parameters]))
        entries = [name for v in component.parameters for name in v.names]
        for i, name in enumerate(names):
            p[entries.index(name)] = theta[i]
        after = component.step(state, u, p, 0.0, log.period)
        angles = pantograph.base_angles(pose, values) / device.encoder_resolution
        counts = ca.Function("counts", [pose], [angles, ca.jacobian(angles, pose)])
        step = ca.Function("step", [state, u, theta], [after])
        slopes = [ca.jacobian(after, state), ca.jacobian(after, theta)]
        samples = n * len(self._windows)
        self._path = step.mapaccum(n).map(len(self._windows))
        self._counts = counts.map(samples)
        self._slopes = ca.Function("slopes", [state, u, theta], slopes).map(samples)
        hand = np.zeros_like(log.pose) if log.hand is None else log.hand
        # The motors hold their wrench from sample to sample, a hand of flesh does not.
        assert log.motors is not None
        acts = hand[:-1] if log.held else (hand[:-1] + hand[1:]) / 2
        self._inputs = np.hstack([log.motors[:-1], acts])[:samples].T
        self._measured = np.asarray(self._counts(log.pose[1 : samples + 1].T)[0]).T

    def first_states(self) -> Matrix:
        """Poses and velocities at the begin of the windows, (windows, 6), as measured."""
        beside = 8
        rows = np.array([begin for begin, _ in self._windows])
        early, late = (
            np.maximum(rows - beside, 0),
            np.minimum(rows + beside, len(self._log.pose) - 1),
        )
        pose = self._log.pose
        velocity = (pose[late] - pose[early]) / ((late - early)[:, None] * self._log.period)
        return np.hstack([pose[rows], velocity])

    def errors(self, theta: Vector, states: Matrix) -> Vector:
        """All errors (counts), window by window."""
        counts, _ = self._counts(self._after(theta, states)[:3])
        return (np.asarray(counts).T - self._measured).ravel()

    def slopes(self, theta: Vector, states: Matrix, scale: Vector) -> csr_array:
        """By theta over its scale, then by all states: S_k+1 = A_k S_k + B_k from the identity on,
        with A and B those of one step."""
        m, n, windows = len(theta), self._n, len(states)
        after = self._after(theta, states)
        earlier = after.reshape(6, windows, n)[:, :, :-1]
        before = np.concatenate([states.T[:, :, None], earlier], axis=2).reshape(6, -1)
        all_theta = np.repeat(theta[:, None], n * windows, axis=1)
        by_state, by_theta = (
            np.asarray(slopes).reshape(6, windows, n, -1).transpose(2, 1, 0, 3)
            for slopes in self._slopes(before, self._inputs, all_theta)
        )
        S = np.tile(np.hstack([np.zeros((6, m)), np.eye(6)]), (windows, 1, 1))
        along = np.empty((windows, n, 3, m + 6))
        for k in range(n):
            S = by_state[k] @ S
            S[:, :, :m] += by_theta[k]
            along[:, k] = S[:, :3]
        by_pose = np.asarray(self._counts(after[:3])[1])
        by_pose = by_pose.reshape(4, windows, n, 3).transpose(1, 2, 0, 3)
        parts = (by_pose @ along).reshape(windows, 4 * n, m + 6)
        return csr_array(
            hstack([parts[:, :, :m].reshape(-1, m) * scale, block_diag(parts[:, :, m:])])
        )

    def _after(self, theta: Vector, states: Matrix) -> Matrix:
        """The states after each step, (6, windows * n)."""
        each = np.repeat(theta[:, None], self._inputs.shape[1], axis=1)
        return np.asarray(self._path(states.T, self._inputs, each))
