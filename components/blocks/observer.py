"""Observer: pose, velocity and acceleration of a device's handle and the wrench of the hand on it,
from the angles of its driven joints and the torques of its motors (section 4.2.1).

Sampled: q are the angles measured at t_k, tau the torques that were applied over [t_{k-1}, t_k),
by which the states of t_{k-1} are advanced to t_k; so nothing is late, and the outputs are those of
an observer within the device. a = M^-1 (J_q' tau + F_hand_observed - c) is the acceleration just
before t_k. The first sample starts the observer: at rest, without a force, at the pose next to
x_start that belongs to q.

The equations are in components/device/observer.py and kalman_observer.py, the device's kinematics
in device_model.py.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.device import observer_laws
from hapticlink.components.device.models import device_model
from hapticlink.components.device.variables import in_port, seen, start_pose
from hapticlink.components.specs.device import Device

_PERIOD = Variable("period", (), "s", description="time since the last sample, 0 before the first")


def observer(device: Device) -> Component:
    """The observer of a device, with the gains of its [device.observer]."""
    model = device_model(device)
    units = tuple(sensed.joint.kind.units[0] for sensed in model.encoders)
    m, space = (len(model.motors),), device.space
    pose, velocity, *others = seen(space, force=True)
    text = "observed acceleration of the handle"
    acceleration = Variable("a", *space.acceleration, description=text)
    block = Block(
        inputs=[
            Variable("q", (len(units),), units, description="measured joint coordinates"),
            Variable("tau", m, "N.m", description="torques of the motors until now"),
        ],
        parameters=[start_pose(space), *model.parameters, *observer_laws.parameters(model)],
        states=[*observer_laws.states(model), _PERIOD],
        outputs=[pose, velocity, acceleration, *others],
    )
    x, u, p = block.x, block.u, block.p
    law = observer_laws.observer(model, p)
    now = law.advance(law.read(x), u["q"], u["tau"], x["period"])
    guess = model.place_at_pose(p["x_start"], p)
    # The first output advances the start by a period of 0.
    first = law.start(u["q"], guess).unsampled(guess)
    initial = first.states | {"period": ca.SX(0)}
    estimate = law.outputs(now) | {"a": law.acceleration(now, u["tau"])}
    return block.component(
        "observer",
        "Observer of a device's handle and of the hand's wrench on it",
        "sampled",
        initial=initial,
        step=now.states | {"period": block.h},
        output=in_port(model.directions, estimate, p["x_start"]),
        documentation=__doc__ or "",
    )
