"""The laws of an observer: by the one that a device has, its states, its parameters, and the
observer itself."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Protocol

import casadi as ca

from hapticlink.components.component import Signals, Variable
from hapticlink.components.device import variables
from hapticlink.components.device.device_model import DeviceModel
from hapticlink.components.device.kalman_observer import NOMINAL, KalmanObserver, bandwidth
from hapticlink.components.device.motors_and_encoders import mass_and_count
from hapticlink.components.device.observer import HandleObserver
from hapticlink.components.ports import STEP_SIZE

BY_A_COUNT, FASTEST = 0.11, 300.0
"""Error of the force (N) by a count from which the default bandwidth of nicosia follows, and the
largest one (rad/s)."""


class DeviceObserver(Protocol):
    """What a block asks of an observer, whose estimate is of a type of its own."""

    def read(self, x: Mapping[str, ca.SX]) -> Any: ...
    def start(self, angles: ca.SX, guess: ca.SX) -> Any: ...
    def advance(self, before: Any, angles: ca.SX, tau: ca.SX, period: ca.SX) -> Any: ...
    def outputs(self, now: Any) -> dict[str, ca.SX]: ...
    def acceleration(self, now: Any, tau: ca.SX) -> ca.SX: ...


def states(model: DeviceModel) -> tuple[Variable, ...]:
    """What the device's observer keeps."""
    if model.device.observer.law == "nicosia":
        return (
            variables.place(model, "x_measured", "pose from the encoders"),
            variables.felt(model, "pose", "x_observer", "observer state x1"),
            variables.felt(model, "twist", "v_observer", "observer state x2"),
        )
    return (
        variables.place(model, "x_observer", "estimated pose"),
        variables.felt(model, "twist", "v_observer", "estimated velocity"),
        variables.felt(model, "wrench", "F_observer", "estimated wrench of the hand"),
    )


def parameters(model: DeviceModel) -> list[Variable]:
    """The gains of the device's observer, and the period where the bandwidth follows from it."""
    spec = model.device.observer
    if spec.law == "kalman":
        if spec.omega_n is None:
            return [Variable(STEP_SIZE, (), "s", NOMINAL, "communication step size", "fixed")]
        return [_omega_n(spec.omega_n)]
    omega_n = default_bandwidth(model) if spec.omega_n is None else spec.omega_n
    k_D = 2 * omega_n if spec.k_D is None else spec.k_D
    return [_omega_n(omega_n), Variable("k_D", (), "1/s", k_D, "output gain of the observer")]


def _omega_n(value: float) -> Variable:
    return Variable("omega_n", (), "rad/s", value, "bandwidth of the observer")


def default_bandwidth(model: DeviceModel) -> float:
    """omega_n (rad/s) of nicosia at which a count Delta is an error of F of BY_A_COUNT,
    m Delta omega_n^2, to two digits; at most FASTEST."""
    mass, count = mass_and_count(model)
    found = math.sqrt(BY_A_COUNT / (mass * count))
    return min(float(f"{found:.1e}"), FASTEST)


def observer(model: DeviceModel, p: Signals) -> DeviceObserver:
    """The observer of a device with parameters p, `parameters` among them; without an omega_n
    there it is defined."""
    spec = model.device.observer
    if spec.law == "nicosia":
        return HandleObserver(model, p, spec.rule)
    if STEP_SIZE in p:
        p.define("omega_n", bandwidth(model) * (NOMINAL / p[STEP_SIZE]) ** 0.2)
    return KalmanObserver(model, p)
