"""The laws of an observer: by the one that a device has, its states, its parameters, and the
observer itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import casadi as ca

from hapticlink.components.component import STEP_SIZE, Signals, Variable
from hapticlink.components.device import pantograph
from hapticlink.components.device.kalman_observer import NOMINAL, KalmanObserver, bandwidth
from hapticlink.components.device.observer import HandleObserver
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.device import Device

_STATES = {
    "nicosia": (
        Variable("x_measured", *PLANE.pose, description="pose from the encoders"),
        Variable("x_observer", *PLANE.pose, description="observer state x1"),
        Variable("v_observer", *PLANE.twist, description="observer state x2"),
    ),
    "kalman": (
        Variable("x_observer", *PLANE.pose, description="estimated pose"),
        Variable("v_observer", *PLANE.twist, description="estimated velocity"),
        Variable("F_observer", *PLANE.wrench, description="estimated wrench of the hand"),
    ),
}


class DeviceObserver(Protocol):
    """What a block asks of an observer, whose estimate is of a type of its own."""

    def read(self, x: Mapping[str, ca.SX]) -> Any: ...
    def start(self, angles: ca.SX, guess: ca.SX) -> Any: ...
    def advance(self, before: Any, angles: ca.SX, tau: ca.SX, period: ca.SX) -> Any: ...
    def outputs(self, now: Any) -> dict[str, ca.SX]: ...
    def acceleration(self, now: Any, tau: ca.SX) -> ca.SX: ...


def states(device: Device) -> tuple[Variable, ...]:
    """What the device's observer keeps."""
    return _STATES[device.observer.law]


def parameters(device: Device) -> list[Variable]:
    """The gains of the device's observer, and the period where the bandwidth follows from it."""
    spec = device.observer
    if spec.law == "kalman" and spec.omega_n is None:
        return [Variable(STEP_SIZE, (), "s", NOMINAL, "communication step size", "fixed")]
    omega_n = Variable("omega_n", (), "rad/s", spec.omega_n or 50.0, "bandwidth of the observer")
    k_D = Variable("k_D", (), "1/s", spec.k_D, "output gain of the observer")
    return [omega_n, k_D] if spec.law == "nicosia" else [omega_n]


def observer(device: Device, p: Signals) -> DeviceObserver:
    """The observer of a device with parameters p, `parameters` among them; without an omega_n
    there it is defined."""
    if device.observer.law == "nicosia":
        return HandleObserver(pantograph, p, device.observer.rule)
    if STEP_SIZE in p:
        p.define("omega_n", bandwidth(device) * (NOMINAL / p[STEP_SIZE]) ** 0.2)
    return KalmanObserver(pantograph, p)
