"""Forces, moments and motor torques of a haptic run over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.tracking import further_users, of_block
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.base.signal_names import (
    CONTACT_GAP,
    DRIFT_WRENCH,
    ENVIRONMENT_WRENCH,
    HAND_WRENCH,
    MEASURED_HANDLE_POSE,
    MOTOR_WRENCH,
    TOPOLOGY_WRENCH,
    signal_of_user,
)
from hapticlink.orchestrator.results.read_results import Results, Vector

WRENCHES = {
    HAND_WRENCH: "hand, F_hand",
    DRIFT_WRENCH: "virtual coupling, F_drift",
    TOPOLOGY_WRENCH: "topology controller, F_T",
    ENVIRONMENT_WRENCH: "contacts and other hands, F_env",
}
"""By signal, what it is called; each is (N, N, N.m)."""


def wrenches(results: Results, user: str = "") -> dict[str, tuple[Vector, Vector, Vector]]:
    """By name: times (s), force (N) and moment (N.m) of each wrench of a user that the run has."""
    wrenches_by_name = {}
    for signal, name in WRENCHES.items():
        signal = signal_of_user(signal, user)
        if (table := of_block(results, signal, 3)) and len(table["time"]):
            rows = results.within(table["time"])
            F = table[signal][rows]
            wrenches_by_name[name] = table["time"][rows], PLANE.distance(F), F[:, 2]
    return wrenches_by_name


def all_wrenches(results: Results) -> dict[str, tuple[Vector, Vector, Vector]]:
    """As `wrenches`, of all users; those of further ones have their point's name first."""
    users = ["", *further_users(results)]
    return {
        f"{user}: {name}" if user else name: found
        for user in users
        for name, found in wrenches(results, user).items()
    }


def touching(results: Results) -> tuple[Vector, NDArray[np.bool_]] | None:
    """Times (s), and whether contacts push then; None without contacts. F_env alone does not tell:
    it has other hands and efforts on joints, too."""
    force, gap = of_block(results, ENVIRONMENT_WRENCH, 3), of_block(results, CONTACT_GAP)
    if not (force and gap):
        return None
    rows = results.within(force["time"])
    pushes = (force[ENVIRONMENT_WRENCH] != 0).any(axis=1) & (gap[CONTACT_GAP] < 0)
    return force["time"][rows], pushes[rows]


def torques(
    results: Results, device: Device | None, user: str = ""
) -> tuple[Vector, Vector] | None:
    """Times (s) and torques (N.m) of the four motors of a user's device, None without one that is
    driven."""
    # casadi, which the terminal's lines, of the same module, can do without
    from hapticlink.components.device.motors_and_encoders import motor_torques

    motor, handle = signal_of_user(MOTOR_WRENCH, user), signal_of_user(MEASURED_HANDLE_POSE, user)
    table = of_block(results, motor, 3)
    if device is None or table is None or of_block(results, handle, 3) is not table:
        return None
    if not len(table["time"]):
        return None
    rows = results.within(table["time"])
    return table["time"][rows], motor_torques(device, table[motor][rows], table[handle][rows])
