"""Settings of blocks that are start values of parameters and nothing else: no equation depends on
them, so that one FMU serves all their values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

from hapticlink.components.specs.control import PassivityLaw, Topology

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


def _at(table: Any, path: Sequence[str]) -> Any:
    """The value at a path below a table, None where there is none."""
    return reduce(lambda inner, name: getattr(inner, name, None), path, table)


def _with(table: Any, path: Sequence[str], value: Any) -> Any:
    """The table with a value at a path below it."""
    if not path:
        return value
    return replace(table, **{path[0]: _with(getattr(table, path[0]), path[1:], value)})
