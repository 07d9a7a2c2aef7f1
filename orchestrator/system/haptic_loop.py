"""The report's block diagram (figures 4.1 and 4.4) as a table of connections.

A row becomes a connection where both of its ends exist. x_start and x_ref are parameters that are
set once, in initialisation mode, so that the device starts at the pose of the mechanism. F_drift
acts on the device with + and on the mechanism with -; the mechanism applies the minus itself. The
hand moves with the true pose of the handle, not with the measured one; without a device it moves
with the operational point.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from hapticlink.orchestrator.base.signal_names import (
    DEVICE,
    ENVIRONMENT,
    HAND_WRENCH,
    HANDLE_POSE,
    HANDLE_VELOCITY,
    MECHANISM,
    OBSERVER,
    POINT_POSE,
    POINT_VELOCITY,
    SHARED,
    signal_of_user,
)
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.scene.blocks import observed_beside
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.scene_tables import Wire

Row = tuple[str, str]

_LOOP: tuple[Row, ...] = (
    ("virtual_mechanism.x", "haptic_device.x_start"),
    ("virtual_mechanism.x", "observer.x_start"),
    ("virtual_mechanism.x", "controller.x_ref"),
    ("hand.F", "haptic_device.F_hand"),
    ("haptic_device.x", "controller.x_D"),
    ("haptic_device.v", "controller.v_D"),
    ("haptic_device.M", "controller.M"),
    ("haptic_device.c", "controller.c"),
    ("haptic_device.q", "observer.q"),
    ("haptic_device.tau_applied", "observer.tau"),
    ("observer.x", "motor_map.x"),
    ("controller.F_motor", "motor_map.F_motor"),
    ("motor_map.tau", "haptic_device.tau"),
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
    ("haptic_device.x", "virtual_mechanism.x_handle"),
    ("virtual_mechanism.asked_point", "virtual_environment.asked_point"),
    ("virtual_environment.ready_point", "virtual_mechanism.ready_point"),
    ("virtual_mechanism.held_point", "controller.held_point"),
    ("virtual_mechanism.held_point", "hand.held_point"),
    ("controller.F_motor", "haptic_device.F_motor"),
    ("controller.F_drift", "virtual_mechanism.F_drift"),
)
"""The connections of every scene, as those of the first user."""
_OBSERVED = {
    f"{DEVICE}.{port}": f"{OBSERVER}.{port}" for port in ("x", "v", "M", "c", "F_hand_observed")
}
"""What comes from the observer where that is beside the device."""


def rows(scene: Scene) -> tuple[Wire, ...]:
    return tuple(Wire(from_=source, to=target) for source, target in _rows(scene))


def wires(rows: Iterable[Wire], described: Mapping[str, Description]) -> tuple[Wire, ...]:
    """The rows of which both ends are variables of the scene's blocks, `described` by name."""

    def has(end: str, *causalities: str) -> bool:
        block, port = end.split(".", 1)
        return block in described and bool(described[block].port(port, *causalities))

    return tuple(
        row for row in rows if has(row.from_, "output") and has(row.to, "input", "parameter")
    )


def _rows(scene: Scene) -> tuple[Row, ...]:
    """(source, target) as `fmu.variable`, for every connection that the scene may have."""
    own = [row for row in _LOOP if any(end.partition(".")[0] not in SHARED for end in row)]
    further: list[Row] = []
    for user in {**scene.hands, **scene.devices}:
        rows = (*(own if user in scene.devices else ()), *_scene_rows(scene, user))
        measured = _from_observer(scene, user, rows)
        further += [(signal_of_user(a, user), signal_of_user(b, user)) for a, b in measured]
    tables = _LOOP, _scene_rows(scene, "")
    first, last = (_from_observer(scene, "", rows) for rows in tables)
    return (*first, *further, *last)


def _from_observer(scene: Scene, user: str, rows: Iterable[Row]) -> list[Row]:
    """Connections of a user, as those of the first one, from the observer where one is beside the
    device."""
    beside = user in observed_beside(scene)
    return [(_OBSERVED.get(a, a) if beside else a, b) for a, b in rows]


def _scene_rows(scene: Scene, user: str) -> tuple[Row, ...]:
    """The connections of a user that depend on the scene, as those of the first user, whose name is
    empty."""
    device = scene.devices.get(user) if user else scene.device
    x, v = (HANDLE_POSE, HANDLE_VELOCITY) if device else (POINT_POSE, POINT_VELOCITY)
    observed = device and scene.sensing != "ideal"
    wrench = "haptic_device.F_hand_observed" if observed else HAND_WRENCH
    directions = ENVIRONMENT if scene.directions_from == "graphics" else MECHANISM
    return (
        (x, "hand.x"),
        (v, "hand.v"),
        (wrench, "controller.F_hand"),
        (wrench, "virtual_mechanism.F_hand"),
        (f"{directions}.Lambda_inv", "controller.Lambda_inv"),
        (f"{directions}.P_c", "controller.P_c"),
    )


def energy_in_play(scene: Scene) -> float | None:
    """Scale (J) of the linkage's gravitational potential energy: weight times the sum of all link
    lengths. None where not only wrenches at its points put energy into it: with drives, forces of
    plugins, a held local model or held contacts, or an FMU in the place of a block."""
    linkage = scene.linkage
    replaced = any(f.replaces for f in scene.fmu)
    held = scene.local_model or (scene.contacts and scene.contacts.detection == "graphics")
    if linkage is None or replaced or held or linkage.force or linkage.driven:
        return None
    spans = [p for j in linkage.joint for p in (j.at_parent, j.at_child) if p]
    spans += [b.center for b in linkage.body if b.center]
    mass = sum(b.mass for b in linkage.body)
    return math.hypot(*linkage.gravity or (0.0,)) * mass * sum(math.hypot(*p) for p in spans)
