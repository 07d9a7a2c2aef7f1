"""The report's block diagram (figures 4.1 and 4.4) as a table of connections.

A row is made where both ends exist. x_start and x_ref are parameters: they are set once, in
initialisation, so the device starts where the mechanism is. F_drift acts on the device as +
and on the mechanism as -; the minus is the mechanism's own. The hand holds the true handle, not
the measured one; without a device it holds the operational point itself.
"""

from __future__ import annotations

from hapticlink.orchestrator.scene.records import PowerPort, SetSpring
from hapticlink.orchestrator.scene.scene import Scene

Row = tuple[str, str]

_LOOP: tuple[Row, ...] = (
    ("virtual_mechanism.x", "haptic_device.x_start"),
    ("virtual_mechanism.x", "controller.x_ref"),
    ("hand.F", "haptic_device.F_hand"),
    ("haptic_device.x", "controller.x_D"),
    ("haptic_device.v", "controller.v_D"),
    ("haptic_device.M", "controller.M"),
    ("haptic_device.c", "controller.c"),
    ("virtual_mechanism.x", "controller.x_S"),
    ("virtual_mechanism.v", "controller.v_S"),
    ("virtual_mechanism.a_bias", "controller.a_bias"),
    ("virtual_mechanism.F_env", "controller.F_env"),
    ("virtual_mechanism.x", "virtual_environment.x_ref"),
    ("virtual_mechanism.v", "virtual_environment.v_ref"),
    ("virtual_mechanism.q", "virtual_environment.q_ref"),
    ("virtual_mechanism.qd", "virtual_environment.qd_ref"),
    ("virtual_environment.contacts", "virtual_mechanism.contacts"),
    ("virtual_environment.D", "virtual_mechanism.D"),
    ("virtual_environment.W", "virtual_mechanism.W"),
    ("virtual_environment.w", "virtual_mechanism.w"),
    ("virtual_environment.J_h", "virtual_mechanism.J_h"),
    ("controller.F_motor", "haptic_device.F_motor"),
    ("controller.F_drift", "virtual_mechanism.F_drift"),
)


def connections(scene: Scene) -> tuple[Row, ...]:
    """(source, target) as `fmu.variable`, of every connection that the scene may have."""
    felt = "hand.F" if scene.sensing == "ideal" else "haptic_device.F_hand_observed"
    directions = {"graphics": "virtual_environment", "mechanism": "virtual_mechanism"}
    giver = directions[scene.directions_from]
    held = ("haptic_device.x_true", "haptic_device.v_true")
    if not scene.device:
        held = ("virtual_mechanism.x", "virtual_mechanism.v")
    further: list[Row] = []
    for name in scene.hands:
        hand, at = f"hand_{name}", f"virtual_mechanism.{name}"
        further += [
            (f"{hand}.F", f"{at}.F_hand"),
            (f"{at}.x", f"{hand}.x"),
            (f"{at}.v", f"{hand}.v"),
        ]
    return (
        *_LOOP,
        *further,
        (held[0], "hand.x"),
        (held[1], "hand.v"),
        (felt, "controller.F_hand"),
        (felt, "virtual_mechanism.F_hand"),
        (f"{giver}.Lambda_inv", "controller.Lambda_inv"),
        (f"{giver}.P_c", "controller.P_c"),
    )


KINDS = {"P_c": "projector"} | dict.fromkeys(("Lambda_inv", "M", "D"), "semidefinite")
"""By the port of the source. A scene's [kinds] says it for other FMUs."""


DERIVATIVES = {"x": "v", "v": "a", "q": "qd", "qd": "qdd", "x_true": "v_true"}
"""The port of a source that is the derivative of another; `der(y)` is that of any y."""


UNMIXED = frozenset({"contacts"})
"""Ports whose samples stand for themselves: no value is made of two of them."""


BLOCKS = (
    PowerPort(effort="virtual_mechanism.F_hand", displacement="virtual_mechanism.x"),
    PowerPort(effort="virtual_mechanism.F_drift", displacement="virtual_mechanism.x", sign=-1.0),
    PowerPort(effort="haptic_device.F_hand", displacement="haptic_device.x_true"),
    PowerPort(effort="haptic_device.F_motor", displacement="haptic_device.x_true"),
)
"""Ports of the report's blocks; F_drift acts on the mechanism as -."""


def springs_of(scene: Scene) -> tuple[SetSpring, ...]:
    """Those of [[spring]], and F_drift of the scene's own controller."""
    own: tuple[SetSpring, ...] = ()
    if scene.controller and scene.controller.teleoperation:
        gains = scene.controller.teleoperation
        own = (
            SetSpring(
                set_position="controller.x_S",
                position="controller.x_D",
                stiffness=gains.stiffness,
                damping=gains.damping,
                set_velocity="controller.v_S",
            ),
        )
    return (*scene.spring, *own)
