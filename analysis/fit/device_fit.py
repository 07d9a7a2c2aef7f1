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

from hapticlink.analysis.fit.estimate import FROM_ZERO, Estimate, standard_deviations
from hapticlink.analysis.fit.log import Log
from hapticlink.components.blocks.haptic_device import haptic_device
from hapticlink.components.device import pantograph
from hapticlink.components.device.numeric_torques import numbers
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
        self._counts = ca.Function("counts", [pose], [angles])
        step = ca.Function("step", [state, u, theta], [after])
        s, U, at = ca.MX.sym("s", 6), ca.MX.sym("U", 6, n), ca.MX.sym("theta", len(names))
        path = step.mapaccum(n)(s, U, ca.repmat(at, 1, n))
        path = ca.vec(self._counts.map(n)(path[:3, :]))
        both = ca.vertcat(at, s)
        self._path = ca.Function("path", [at, s, U], [path])
        self._slopes = ca.Function("slopes", [at, s, U], [ca.jacobian(path, both)])
        hand = np.zeros_like(log.pose) if log.hand is None else log.hand
        # The motors hold their wrench from sample to sample, a hand of flesh does not.
        assert log.motors is not None
        acts = hand[:-1] if log.held else (hand[:-1] + hand[1:]) / 2
        self._inputs = np.hstack([log.motors[:-1], acts])
        self._measured = np.asarray(self._counts.map(len(log.pose))(log.pose.T)).T

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
        return np.concatenate(
            [
                np.asarray(self._path(theta, s, self._inputs[begin:end].T)).ravel()
                - self._measured[begin + 1 : end + 1].ravel()
                for s, (begin, end) in zip(states, self._windows, strict=True)
            ]
        )

    def slopes(self, theta: Vector, states: Matrix, scale: Vector) -> Matrix:
        """By theta over its scale, then by all states."""
        m, rows = len(theta), 4 * self._n
        J = np.zeros((rows * len(states), m + states.size))
        for w, (s, (begin, end)) in enumerate(zip(states, self._windows, strict=True)):
            part = np.asarray(self._slopes(theta, s, self._inputs[begin:end].T))
            J[w * rows : (w + 1) * rows, :m] = part[:, :m] * scale
            J[w * rows : (w + 1) * rows, m + 6 * w : m + 6 * (w + 1)] = part[:, m:]
        return J
