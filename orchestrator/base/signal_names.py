"""The names of the haptic loop's blocks and of their signals (`block.port`) that results, analysis
and views look up.

A further user, who holds a device at the point NAME of the linkage, has the blocks `hand_NAME`,
`haptic_device_NAME` and `controller_NAME`; mechanism and environment are shared, with the ports
`NAME.x`, ... for that user. The first user's name is empty.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

HAND = "hand"
DEVICE = "haptic_device"
OBSERVER = "observer"
"""Of a device whose observer is beside it."""
CONTROLLER = "controller"
MOTOR_MAP = "motor_map"
"""That makes torques of the controller's wrench, for the same device."""
MECHANISM = "virtual_mechanism"
ENVIRONMENT = "virtual_environment"
SHARED = (MECHANISM, ENVIRONMENT)
"""The blocks that all users share."""
PASS_ON = (CONTROLLER, MOTOR_MAP)
"""The blocks whose wrenches and torques pass on what hands and mechanism put in."""

HAND_WRENCH = f"{HAND}.F"

HANDLE_POSE = f"{DEVICE}.x_true"
HANDLE_VELOCITY = f"{DEVICE}.v_true"
MEASURED_HANDLE_POSES = (f"{OBSERVER}.x", f"{DEVICE}.x")
"""The measured pose, computed by either block."""
HANDLE_INERTIAS = (f"{OBSERVER}.M", f"{DEVICE}.M")
"""The device's inertia at the handle, computed by either block."""
BOARD_SENT_AT = f"{DEVICE}.sent_at"
"""When torques were sent to a board in the place of the device."""
WORKSPACE_MARGIN = f"{DEVICE}.workspace_margin"
"""Negative (m) where the device is outside its workspace."""

DRIFT_WRENCH = f"{CONTROLLER}.F_drift"
TOPOLOGY_WRENCH = f"{CONTROLLER}.F_constraint"
COUPLING_ENERGY = f"{CONTROLLER}.coupling_energy"
"""Stored in F_drift and F_T, where the operational point changes."""
MOTOR_WRENCH = f"{CONTROLLER}.F_motor"
MOTOR_TORQUES = f"{MOTOR_MAP}.tau"
MOTOR_ANGLES = f"{DEVICE}.theta_true"
"""Both where the observer is beside the device; the torques work over the angles."""
APPLIED_TORQUES = f"{DEVICE}.tau_applied"
TORQUE_LIMITS = f"{DEVICE}.torque_limit"
"""What a device from elsewhere tells of its motors (N.m)."""
PASSIVITY_DAMPING = f"{CONTROLLER}.passivity_damping"
PASSIVITY_ENERGY = f"{CONTROLLER}.passivity_energy_left"

POINT_POSE = f"{MECHANISM}.x"
POINT_VELOCITY = f"{MECHANISM}.v"
POINT_PATH = f"{MECHANISM}.path"
"""Of a mechanism whose operational point changes: its pose, continuous over the changes."""
HELD_POINT = f"{MECHANISM}.held_point"
CHOSEN_POINT = f"{MECHANISM}.point"
JOINT_COORDINATES = f"{MECHANISM}.q"
JOINT_RATES = f"{MECHANISM}.qd"
MULTIPLIERS = f"{MECHANISM}.lambda"
CLOSURE_ERROR = f"{MECHANISM}.closure_error"
CONTACT_GAP = f"{MECHANISM}.contact_gap"
ENVIRONMENT_WRENCH = f"{MECHANISM}.F_env"
MECHANISM_ENERGY = f"{MECHANISM}.energy"
MECHANISM_STOPS = f"{MECHANISM}.stops"

COPY_JOINT_COORDINATES = f"{ENVIRONMENT}.q"
CONTACT_GEOMETRY = f"{ENVIRONMENT}.contacts"
COPY_BRANCH_OK = f"{ENVIRONMENT}.branch_ok"

CONSTRAINT_COUNTS = (f"{ENVIRONMENT}.n_constraints", f"{MECHANISM}.n_constraints")
"""The number of constrained directions, computed by either block."""
MOBILITIES = (f"{ENVIRONMENT}.Lambda_inv", f"{MECHANISM}.Lambda_inv")
"""The mobility at the operational point, computed by either block."""
PROJECTORS = (f"{ENVIRONMENT}.P_c", f"{MECHANISM}.P_c")
"""The projector on the constrained directions, computed by either block."""


User = TypeVar("User")


def by_user(first: User | None, others: Mapping[str, User]) -> dict[str, User]:
    """What each user has, by the user's name; that of the first one is empty."""
    return ({} if first is None else {"": first}) | dict(others)


def block_of_user(block: str, user: str) -> str:
    """The name of a user's block: `controller_left`, or the block itself for the first user and for
    shared blocks."""
    return f"{block}_{user}" if user and block not in SHARED else block


def signal_of_user(signal: str, user: str) -> str:
    """A first user's signal as that of another user: `controller_left.F_drift`,
    `virtual_mechanism.left.F_env`."""
    block, _, port = signal.partition(".")
    prefix = f"{user}." if user and block in SHARED else ""
    return f"{block_of_user(block, user)}.{prefix}{port}"


def user_of_block(name: str, block: str) -> str | None:
    """The user whose `block` an FMU is by its name, None where it is not such a block."""
    own, separator, user = name.partition(f"{block}_")
    if name == block:
        return ""
    return user if not own and separator and user else None
