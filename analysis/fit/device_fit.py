"""The parameters of a device from a log: output errors over short windows.

In window w of N samples the device's own equations (components/blocks/haptic_device.py) are stepped
from a state s_w under the logged wrenches, and

    min over theta and all s_w of  sum |q(x_k(theta, s_w)) - q(x_k)|^2 / delta^2

is solved, with q the joint coordinates at the encoders and delta their resolutions (multiple
shooting: Bock, Springer Series in Chemical Physics 18 (1981), 102). Windows are short, so that it
converges from parameters that are far off, and the free states take up what a longer one would
amplify."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import block_diag, csr_array, hstack

from hapticlink.analysis.fit.estimate import FROM_ZERO, Estimate, standard_deviations
from hapticlink.analysis.fit.log import Log
from hapticlink.components.blocks.haptic_device import haptic_device
from hapticlink.components.device.models import device_model
from hapticlink.components.device.motors_and_encoders import mass_and_count
from hapticlink.components.evaluate_rows import evaluate_rows
from hapticlink.components.specs.device import Device, Motor
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.errors import InputFault

MOTORS = ("motor.inertia", "motor.damping", "motor.friction")
"""Keys of all motors, and the names of their parameters."""
WINDOW = 0.2
"""Length of a window (s)."""
MOVED = 10
"""Counts that the handle moves at least."""


def fitted(device: Device) -> tuple[str, ...]:
    """The keys that a log of any motion determines; masses of links act like those of the handle's
    body and of rotors."""
    body = f"body.{device.handle.body}"
    turns = (f"{body}.inertia",) if device.handle.angle == "held" else ()
    return (f"{body}.mass", *turns, *MOTORS[1:])


def fit_device(log: Log, device: Device, names: Sequence[str] = ()) -> tuple[list[Estimate], float]:
    """Estimates of parameters of [device] by their keys, by default `fitted`, from `device` on, and
    the root mean square of the remaining errors in encoder counts (0.29 where only counting is
    left).

    Raises InputFault for unknown names, and for a log that does not have the motors' wrench or does
    not move the handle.
    """
    names = tuple(names) or fitted(device)
    known = dict.fromkeys((*fitted(device), *MOTORS))
    if unknown := [name for name in names if name not in known]:
        raise InputFault(f"device: {unknown[0]!r} cannot be fitted; {', '.join(known)} can")
    if log.motors is None:
        raise InputFault("device: the log has no wrench of the motors")
    assumed = {name: _value(device, name) for name in names}
    _, count = mass_and_count(device_model(device))
    if np.ptp(log.pose, axis=0).max() < MOVED * count:
        raise InputFault("device: the log does not move the handle by more than a few counts")
    begin: dict[str, Any] = {name: value or FROM_ZERO for name, value in assumed.items()}
    shooting = _Shooting(log, _with(device, begin), names)
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
    units = {name: _parameters(device, name)[1] for name in names}
    estimates = [
        Estimate(f"device.{name}", units[name], float(value), float(sd), assumed[name])
        for name, value, sd in zip(names, found.x * all_scales, spread, strict=False)
    ]
    return estimates, float(np.sqrt(np.mean(found.fun**2)))


def _value(device: Device, name: str) -> float:
    """What a device has at a key; of several motors that of the first."""
    if name in MOTORS:
        return float(getattr(device.motors[0], name.removeprefix("motor.")))
    body = next(body for body in device.body if body.name == device.handle.body)
    return float(getattr(body, name.rpartition(".")[2]))


def _with(device: Device, values: Mapping[str, float]) -> Device:
    """The device with other values at keys, those of motors at all of them."""
    own, motor = dict[str, Any](), dict[str, Any]()
    for name, value in values.items():
        (motor if name in MOTORS else own)[name.rpartition(".")[2]] = value
    joints = tuple(
        replace(j, motor=replace(j.motor, **dict.fromkeys(motor)))
        if isinstance(j.motor, Motor)
        else j
        for j in device.joint
    )
    bodies = tuple(replace(b, **own) if b.name == device.handle.body else b for b in device.body)
    return replace(device, body=bodies, joint=joints, motor=replace(device.motor, **motor))


def _parameters(device: Device, name: str) -> tuple[str, str]:
    """The parameter of the device's block that has a key, and its unit."""
    *_, what = name.split(".")
    if name in MOTORS:
        unit = {"inertia": "kg.m2", "damping": "N.m.s/rad", "friction": "N.m"}[what]
        return ("rotor_inertia" if what == "inertia" else f"motor_{what}"), unit
    return f"{device.handle.body}.{what}", "kg" if what == "mass" else "kg.m2"


class _Shooting:
    """Errors of the base angles in counts, and their slopes, by window."""

    def __init__(self, log: Log, device: Device, names: Sequence[str]) -> None:
        self.component = component = haptic_device(device)
        n = max(int(WINDOW / log.period), 16)
        self._windows = [*pairwise(range(0, len(log.pose), n))]
        self._log, self._n = log, n
        model = device_model(device)
        places = len(model.start_place)
        self._places, self._size = places, sum(v.size for v in component.states)
        pose, place = ca.SX.sym("pose", 3), ca.SX.sym("place", places)
        state = ca.SX.sym("state", self._size)
        theta, u = ca.SX.sym("theta", len(names)), ca.SX.sym("u", 6)
        p = ca.SX(ca.DM([*component.start_parameters]))
        entries = [name for v in component.parameters for name in [v.name] * v.size]
        for i, name in enumerate(names):
            parameter, _ = _parameters(device, name)
            for k, entry in enumerate(entries):
                if entry == parameter:
                    p[k] = theta[i]
        after = component.step(state, u, p, 0.0, log.period)
        resolutions = ca.DM([sensed.resolution for sensed in device.encoders])
        angles = model.angles(place, model.numbers) / resolutions
        counts = ca.Function("counts", [place], [angles, ca.jacobian(angles, place)])
        self._at_pose = ca.Function("at_pose", [pose], [model.place_at_pose(pose)])
        self._model = model
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
        self._measured = np.asarray(self._counts(self._placed(log.pose[1 : samples + 1]))[0]).T

    def first_states(self) -> Matrix:
        """Places and velocities at the begin of the windows, (windows, states), as measured."""
        beside = 8
        rows = np.array([begin for begin, _ in self._windows])
        early, late = (
            np.maximum(rows - beside, 0),
            np.minimum(rows + beside, len(self._log.pose) - 1),
        )
        pose = self._log.pose
        velocity = (pose[late] - pose[early]) / ((late - early)[:, None] * self._log.period)
        along = velocity @ np.array(self._model.directions.rows).T
        return np.hstack([self._placed(pose[rows]).T, along])

    def _placed(self, poses: Matrix) -> Matrix:
        """The places, a column each, at poses (k, 3)."""
        return evaluate_rows(self._at_pose, poses).T

    def errors(self, theta: Vector, states: Matrix) -> Vector:
        """All errors (counts), window by window."""
        counts, _ = self._counts(self._after(theta, states)[: self._places])
        return (np.asarray(counts).T - self._measured).ravel()

    def slopes(self, theta: Vector, states: Matrix, scale: Vector) -> csr_array:
        """By theta over its scale, then by all states: S_k+1 = A_k S_k + B_k from the identity on,
        with A and B those of one step."""
        m, n, windows, size = len(theta), self._n, len(states), self._size
        after, places = self._after(theta, states), self._places
        earlier = after.reshape(size, windows, n)[:, :, :-1]
        before = np.concatenate([states.T[:, :, None], earlier], axis=2).reshape(size, -1)
        all_theta = np.repeat(theta[:, None], n * windows, axis=1)
        by_state, by_theta = (
            np.asarray(slopes).reshape(size, windows, n, -1).transpose(2, 1, 0, 3)
            for slopes in self._slopes(before, self._inputs, all_theta)
        )
        S = np.tile(np.hstack([np.zeros((size, m)), np.eye(size)]), (windows, 1, 1))
        along = np.empty((windows, n, places, m + size))
        for k in range(n):
            S = by_state[k] @ S
            S[:, :, :m] += by_theta[k]
            along[:, k] = S[:, :places]
        by_place = np.asarray(self._counts(after[:places])[1])
        sensed = len(by_place)
        by_place = by_place.reshape(sensed, windows, n, places).transpose(1, 2, 0, 3)
        parts = (by_place @ along).reshape(windows, sensed * n, m + size)
        return csr_array(
            hstack([parts[:, :, :m].reshape(-1, m) * scale, block_diag(parts[:, :, m:])])
        )

    def _after(self, theta: Vector, states: Matrix) -> Matrix:
        """The states after each step, (states, windows * n)."""
        each = np.repeat(theta[:, None], self._inputs.shape[1], axis=1)
        return np.asarray(self._path(states.T, self._inputs, each))
