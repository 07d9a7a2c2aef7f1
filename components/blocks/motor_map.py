"""Motor map: the torques of a device's motors for a wrench at its handle.

    tau = J_q (J_q' J_q)^-1 E F_motor

the torques of least norm at the measured pose x, of the directions E that the device renders. If
one would exceed its limit all are scaled by one factor, so that the wrench keeps its direction.
Sampled; without states."""

from __future__ import annotations

from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.device.models import device_model
from hapticlink.components.device.variables import measured_pose, torque_limit
from hapticlink.components.specs.device import Device


def motor_map(device: Device) -> Component:
    """The motor map of a device."""
    model = device_model(device)
    space, m = device.space, (len(model.motors),)
    F_motor = Variable("F_motor", *space.wrench, 0.0, "desired wrench of the motors")
    block = Block(
        inputs=[F_motor, measured_pose(space)],
        parameters=[*model.parameters, torque_limit(model)],
        outputs=[Variable("tau", m, "N.m", description="torques of the motors")],
    )
    z = model.place_at_pose(block.u["x"], block.p)
    tau = model.motor_torques(model.directions.pick(block.u["F_motor"]), z, block.p)
    return block.component(
        "motor_map",
        "Torques of a device's motors for a wrench at its handle",
        "sampled",
        output={"tau": tau},
        documentation=__doc__ or "",
    )
