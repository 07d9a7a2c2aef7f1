"""Settings of blocks that are start values of parameters and nothing else: no equation depends on
them, so that one FMU serves all their values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

from hapticlink.components.specs.control import PassivityLaw, Topology
from hapticlink.components.specs.linkage import Linkage, coordinates

START_SETTINGS = {
    "controller": {
        "controller.damping": "B_d",
        "controller.stiffness": "K_d",
        "controller.teleoperation.stiffness": "K_pc",
        "controller.teleoperation.damping": "B_pc",
        "controller.topology.stiffness": "k_j",
        "controller.topology.damping": "b_j",
        "controller.passivity.energy": "passivity_energy",
        "controller.passivity.limit": "passivity_limit",
        "controller.passivity.noise": "passivity_noise",
        "controller.passivity.reset_after": "passivity_reset_after",
    },
    "hand": {
        "hand.wrench": "wrench",
        "hand.mass": "mass",
        "hand.stiffness": "stiffness",
        "hand.damping": "damping",
        "hand.grip_stiffness": "grip_stiffness",
        "hand.grip_damping": "grip_damping",
        "hand.pulp_stiffness": "pulp_stiffness",
        "hand.pulp_damping": "pulp_damping",
    },
}
"""By block, and by dotted key of its settings: the parameter that starts at the setting, entry by
entry."""
TABLES = {"controller": {"controller.topology": Topology, "controller.passivity": PassivityLaw}}
"""By block and key: the table whose defaults `true` stands for."""
NOMINAL = 1.0
"""What stands for each entry in the settings of which the FMU is built."""


def without_start_values(
    block: str, settings: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, tuple[float, ...]]]:
    """The settings of a block with NOMINAL for its start settings, and these by parameter. What a
    scene does not set stays so: it is a part that the block does not have."""
    common, starts = dict(settings), dict[str, tuple[float, ...]]()
    for key, record in TABLES.get(block, {}).items():
        first, *path = key.split(".")
        if _at(common.get(first), path) is True:
            common[first] = _with(common[first], path, record())
    for key, parameter in START_SETTINGS.get(block, {}).items():
        first, *path = key.split(".")
        table: Any = common.get(first)
        value = _at(table, path)
        if isinstance(value, tuple):
            starts[parameter] = value
            common[first] = _with(table, path, (NOMINAL,) * len(value))
        elif isinstance(value, int | float) and not isinstance(value, bool):
            starts[parameter] = (value,)
            common[first] = _with(table, path, NOMINAL)
    return common, starts


START_POSE = ("q_start", "q_ref")
"""The variables of blocks with a linkage that start at the joint coordinates of its `start`."""


def has_free_start(settings: Mapping[str, Any]) -> bool:
    """Whether no equation of a block depends on the numbers of its linkage's `start`, as long as
    loops close and choose the same coordinates (dynamics/start_poses.py). They do where scales of
    friction, offsets of gears, contacts or the local model follow from the start pose, or where it
    is checked against start rates, or for bodies without mass."""
    linkage = settings.get("linkage")
    return (
        isinstance(linkage, Linkage)
        and not (settings.get("contacts") or settings.get("local_model"))
        and not (linkage.start_velocity or linkage.choices or linkage.rubbing or linkage.force)
        and all(gear.offset is not None for gear in linkage.gear)
        and all(body.mass and body.moments[0] for body in linkage.body)
    )


def start_pose(linkage: Linkage) -> dict[str, tuple[float, ...]]:
    """The start values of START_POSE."""
    return dict.fromkeys(START_POSE, tuple(coordinates(linkage, linkage.start)))


def _at(table: Any, path: Sequence[str]) -> Any:
    """The value at a path below a table, None where there is none."""
    return reduce(lambda inner, name: getattr(inner, name, None), path, table)


def _with(table: Any, path: Sequence[str], value: Any) -> Any:
    """The table with a value at a path below it."""
    if not path:
        return value
    return replace(table, **{path[0]: _with(getattr(table, path[0]), path[1:], value)})
