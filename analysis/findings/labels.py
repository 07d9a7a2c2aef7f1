"""Blocks and signals of the haptic loop in words, as tables, figures and pages name them."""

from __future__ import annotations

from collections.abc import Iterable

from hapticlink.orchestrator.base.signal_names import (
    CONTROLLER,
    DEVICE,
    ENVIRONMENT,
    HAND,
    MECHANISM,
    MOTOR_MAP,
    OBSERVER,
    user_of_block,
)

BLOCKS = {
    HAND: "hand",
    DEVICE: "device",
    OBSERVER: "observer",
    CONTROLLER: "controller",
    MOTOR_MAP: "motors",
    MECHANISM: "mechanism",
    ENVIRONMENT: "graphics copy",
}
SIGNALS = {
    "F": "hand force",
    "F_hand": "hand force",
    "F_motor": "motor force",
    "F_drift": "coupling force",
    "F_env": "contact force",
    "F_constraint": "topology force",
    "Lambda_inv": "mobility",
    "tau": "motor torques",
    "P_c": "constrained directions",
    "x": "pose",
    "v": "velocity",
    "q": "joint coordinates",
    "qd": "joint rates",
}
"""By the last part of a port's name; all others stand as they are."""


def signal(name: str) -> str:
    """A signal `block.port`, or `block.user.port`, in words: `mobility`, `left: coupling force`."""
    fmu, _, port = name.partition(".")
    user, _, last = port.rpartition(".")
    users = (user_of_block(fmu, own) for own in BLOCKS)
    user = user or next((found for found in users if found), "")
    words = SIGNALS.get(last, last) if block(fmu) else name
    return f"{user}: {words}" if user else words


def connection(name: str) -> str:
    """A connection `source -> target` in words: `coupling force on the mechanism`, `pose of the
    mechanism to the controller`."""
    source, arrow, target = name.partition(" -> ")
    if not arrow:
        return name
    of, to = (end.partition(".")[0] for end in (source, target))
    at = f"the {known}" if (known := block(to)) else to
    if ".F" in target or target.endswith(".tau"):
        return f"{signal(source)} on {at}"
    return f"{signal(source)} of the {block(of)} to {at}" if block(of) else f"{source} to {at}"


def connections(names: Iterable[str]) -> dict[str, str]:
    """Connections in words, by name; as they are where the words would be those of another."""
    said = {name: connection(name) for name in names}
    every = [*said.values()]
    return {name: text if every.count(text) == 1 else name for name, text in said.items()}


def block(name: str) -> str:
    """A block in words, "" for an FMU that is none of the loop's."""
    return next((w for b, w in BLOCKS.items() if user_of_block(name, b) is not None), "")
