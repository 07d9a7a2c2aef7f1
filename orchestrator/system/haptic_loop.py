"""The report's block diagram (figures 4.1 and 4.4) as a table of connections.

A row becomes a connection where both of its ends exist. x_start and x_ref are parameters that are
set once, in initialisation mode, so that the device starts at the pose of the mechanism. F_drift
acts on the device with + and on the mechanism with -; the mechanism applies the minus itself. The
hand moves with the true pose of the handle, not with the measured one; without a device it moves
with the operational point.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.scene.records import Wire
from hapticlink.orchestrator.scene.scene import Scene

Row = tuple[str, str]
MECHANISM, CONTROLLER = "virtual_mechanism", "controller"
WORKSPACE = ("haptic_device", "workspace_margin")
"""The output (m) that is negative where the device is outside its workspace."""

_LOOP: tuple[Row, ...] = (
    ("virtual_mechanism.{at}x", "haptic_device{of}.x_start"),
    ("virtual_mechanism.{at}x", "controller{of}.x_ref"),
    ("hand{of}.F", "haptic_device{of}.F_hand"),
    ("haptic_device{of}.x", "controller{of}.x_D"),
    ("haptic_device{of}.v", "controller{of}.v_D"),
    ("haptic_device{of}.M", "controller{of}.M"),
    ("haptic_device{of}.c", "controller{of}.c"),
    ("virtual_mechanism.{at}x", "controller{of}.x_S"),
    ("virtual_mechanism.{at}v", "controller{of}.v_S"),
    ("virtual_mechanism.{at}a_bias", "controller{of}.a_bias"),
    ("virtual_mechanism.{at}F_env", "controller{of}.F_env"),
    ("virtual_mechanism.x", "virtual_environment.x_ref"),
    ("virtual_mechanism.v", "virtual_environment.v_ref"),
    ("virtual_mechanism.q", "virtual_environment.q_ref"),
    ("virtual_mechanism.qd", "virtual_environment.qd_ref"),
    ("virtual_environment.contacts", "virtual_mechanism.contacts"),
    ("virtual_environment.D", "virtual_mechanism.D"),
    ("virtual_environment.W", "virtual_mechanism.W"),
    ("virtual_environment.w", "virtual_mechanism.w"),
    ("virtual_environment.J_h", "virtual_mechanism.J_h"),
    ("controller{of}.F_motor", "haptic_device{of}.F_motor"),
    ("controller{of}.F_drift", "virtual_mechanism.{at}F_drift"),
)
"""Rows with {of} are those of a user: for the first one {of} and {at} are empty, for the one at a
further point they are the suffix of its blocks and the prefix of its ports."""

_HELD: tuple[Row, ...] = (
    ("{handle}x{true}", "hand{of}.x"),
    ("{handle}v{true}", "hand{of}.v"),
    ("{wrench}", "controller{of}.F_hand"),
    ("{wrench}", "virtual_mechanism.{at}F_hand"),
    ("{directions}.{at}Lambda_inv", "controller{of}.Lambda_inv"),
    ("{directions}.{at}P_c", "controller{of}.P_c"),
)
"""What depends on the scene: {handle} is that of the device or the point of the mechanism, {wrench}
the hand's or its observer's."""


def rows(scene: Scene) -> tuple[Wire, ...]:
    return tuple(Wire(from_=source, to=target) for source, target in _rows(scene))


def wires(scene: Scene, described: Mapping[str, Description]) -> tuple[Wire, ...]:
    """The rows of which both ends are variables of the scene's blocks, `described` by name."""

    def has(end: str, *causalities: str) -> bool:
        block, port = end.split(".", 1)
        return block in described and bool(described[block].port(port, *causalities))

    return tuple(
        row for row in rows(scene) if has(row.from_, "output") and has(row.to, "input", "parameter")
    )


def _rows(scene: Scene) -> tuple[Row, ...]:
    """(source, target) as `fmu.variable`, for every connection that the scene may have."""
    first = [_formatted(row, {"of": "", "at": ""}) for row in _LOOP]
    held = [_formatted(row, _fields(scene, "")) for row in _HELD]
    further: list[Row] = []
    for name in {**scene.hands, **scene.devices}:
        fields = _fields(scene, name)
        own = [row for row in _LOOP if "{of}" in row[0] + row[1]] if name in scene.devices else []
        further += [_formatted(row, fields) for row in (*own, *_HELD)]
    return (*first, *further, *held)


def _formatted(row: Row, fields: Mapping[str, str]) -> Row:
    source, target = row
    return source.format_map(fields), target.format_map(fields)


def _fields(scene: Scene, name: str) -> dict[str, str]:
    """The fields of the user at a further point, or of the first user, whose name is empty."""
    of, at = (f"_{name}", f"{name}.") if name else ("", "")
    device = name in scene.devices if name else scene.device
    ideal = scene.sensing == "ideal" or not device
    return {
        "of": of,
        "at": at,
        "handle": f"haptic_device{of}." if device else f"virtual_mechanism.{at}",
        "true": "_true" if device else "",
        "wrench": f"hand{of}.F" if ideal else f"haptic_device{of}.F_hand_observed",
        "directions": {"graphics": "virtual_environment", "mechanism": "virtual_mechanism"}[
            scene.directions_from
        ],
    }


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
