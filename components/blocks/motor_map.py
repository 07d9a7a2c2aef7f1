"""Motor map: the torques of a device's motors for a wrench at its handle.

    tau = J_q (J_q' J_q)^-1 F_motor

the torques of least norm at the measured pose x. If one would exceed torque_limit all are scaled by
one factor, so that the wrench keeps its direction. Sampled; without states.
"""

from __future__ import annotations

from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.device import pantograph
from hapticlink.components.device.variables import GEOMETRY, TORQUE_LIMIT, X, variables
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.device import Device


def motor_map(device: Device) -> Component:
    """The motor map of a device."""
    block = Block(
        inputs=[Variable("F_motor", *PLANE.wrench, 0.0, "desired wrench of the motors"), X],
        parameters=[
            *variables(device, GEOMETRY, "fixed"),
            *variables(device, TORQUE_LIMIT, "tunable"),
        ],
        outputs=[Variable("tau", (pantograph.MOTORS,), "N.m", description="torques of the motors")],
    )
    tau = pantograph.motor_torques(block.u["F_motor"], block.u["x"], block.p)
    return block.component(
        "motor_map",
        "Torques of a twin pantograph's motors for a wrench at its handle",
        "sampled",
        initial={},
        step={},
        output={"tau": tau},
        documentation=__doc__ or "",
    )
