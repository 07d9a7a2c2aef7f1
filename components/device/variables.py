"""Variables that blocks of the device share: what the observer puts out, and where a device
starts."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.device.device_model import DeviceModel
from hapticlink.components.dynamics.rendered_directions import RenderedDirections
from hapticlink.components.port_space import PLANE

X = Variable("x", *PLANE.pose, description="measured pose of the handle")
V = Variable("v", *PLANE.twist, description="measured velocity of the handle", derivative_of="x")
F_HAND_OBSERVED = Variable(
    "F_hand_observed", *PLANE.wrench, description="observed wrench of the hand"
)
M = Variable("M", *PLANE.inertia, 0.0, "inertia of the device at the handle", kind="semidefinite")
C = Variable("c", *PLANE.wrench, description="C_d v, Coriolis and centrifugal terms at the handle")

X_START = Variable("x_start", *PLANE.pose, 0.0, "pose of the handle at the start", "fixed")


def place(model: DeviceModel, name: str, text: str) -> Variable:
    """A state that is a place of the device."""
    return Variable(name, *model.place, description=text)


def way(model: DeviceModel, name: str, text: str) -> Variable:
    """A state that is a pose in the directions that are felt."""
    k = model.directions.size
    return Variable(name, (k,), PLANE.pose.units[:k], description=text)


def rate(model: DeviceModel, name: str, text: str) -> Variable:
    """A state that is a velocity in the directions that are felt."""
    k = model.directions.size
    return Variable(name, (k,), PLANE.twist.units[:k], description=text)


def force(model: DeviceModel, name: str, text: str) -> Variable:
    """A state that is a force along the directions that are felt."""
    k = model.directions.size
    return Variable(name, (k,), PLANE.wrench.units[:k], description=text)


def torque_limit(model: DeviceModel) -> Variable:
    """The parameter of a motor map."""
    return next(v for v in model.limits if v.name == "torque_limit")


def in_plane(
    directions: RenderedDirections, along: Mapping[str, ca.SX], x_start: ca.SX
) -> dict[str, ca.SX]:
    """What is known along the directions that are felt as entries of the plane: a pose x keeps the
    rest of x_start, all else is 0 there."""

    def whole(name: str, value: ca.SX) -> ca.SX:
        if name == "x":
            return directions.pose(value, x_start)
        return directions.put_matrix(value) if name == "M" else directions.put(value)

    return {name: whole(name, value) for name, value in along.items()}
