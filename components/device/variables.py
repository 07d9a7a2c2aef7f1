"""Variables that blocks of a device share, in the space of its port: what the observer puts out,
and where a device starts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.device.device_model import DeviceModel
from hapticlink.components.dynamics.rendered_directions import RenderedDirections
from hapticlink.components.port_space import PortSpace


def measured_pose(space: PortSpace) -> Variable:
    return Variable("x", *space.pose, description="measured pose of the handle")


def seen(space: PortSpace, *, force: bool) -> tuple[Variable, ...]:
    """What is known of the handle, with the observed force of the hand or without one."""
    velocity, coriolis = "measured velocity of the handle", "C_d v, Coriolis and centrifugal terms"
    hand = Variable("F_hand_observed", *space.wrench, description="observed wrench of the hand")
    inertia = "inertia of the device at the handle"
    return (
        measured_pose(space),
        Variable("v", *space.twist, description=velocity, derivative_of="x"),
        *([hand] if force else []),
        Variable("M", *space.inertia, 0.0, inertia, kind="semidefinite"),
        Variable("c", *space.wrench, description=f"{coriolis} at the handle"),
    )


def start_pose(space: PortSpace) -> Variable:
    return Variable("x_start", *space.pose, 0.0, "pose of the handle at the start", "fixed")


def place(model: DeviceModel, name: str, text: str) -> Variable:
    """A state that is a place of the device."""
    return Variable(name, *model.place, description=text)


def felt(
    model: DeviceModel, kind: Literal["pose", "twist", "wrench"], name: str, text: str
) -> Variable:
    """A state in the directions that are felt: a pose, a velocity or a force."""
    k = model.directions.size
    return Variable(name, (k,), getattr(model.device.space, kind).units[:k], description=text)


def torque_limit(model: DeviceModel) -> Variable:
    """The parameter of a motor map."""
    return next(v for v in model.limits if v.name == "torque_limit")


def in_port(
    directions: RenderedDirections, along: Mapping[str, ca.SX], x_start: ca.SX
) -> dict[str, ca.SX]:
    """What is known along the directions that are felt as entries of the port: a pose x keeps the
    rest of x_start, all else is 0 there."""

    def whole(name: str, value: ca.SX) -> ca.SX:
        if name == "x":
            return directions.pose(value, x_start)
        return directions.put_matrix(value) if name == "M" else directions.put(value)

    return {name: whole(name, value) for name, value in along.items()}
