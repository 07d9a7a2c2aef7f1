"""Forces, moments and motor torques of a haptic run over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.tracking import further_users, of_block, of_user
from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.results.tables import Results, Vector

WRENCHES = {
    "hand.F": "hand, F_hand",
    "controller.F_drift": "virtual coupling, F_drift",
    "controller.F_constraint": "topology controller, F_T",
    "virtual_mechanism.F_env": "contacts and other hands, F_env",
}
"""By signal, what it is called; each is (N, N, N.m)."""
ENVIRONMENT, GAP = "virtual_mechanism.F_env", "virtual_mechanism.contact_gap"
MOTOR, HANDLE = "controller.F_motor", "haptic_device.x"


def wrenches(results: Results, user: str = "") -> dict[str, tuple[Vector, Vector, Vector]]:
    """By name: times (s), force (N) and moment (N.m) of each wrench of a user that the run has."""
    found = {}
    for signal, name in WRENCHES.items():
        signal = of_user(signal, user)
        if (table := of_block(results, signal, 3)) and len(table["time"]):
            F = table[signal]
            found[name] = table["time"], np.hypot(F[:, 0], F[:, 1]), F[:, 2]
    return found


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
    force, gap = of_block(results, ENVIRONMENT, 3), of_block(results, GAP)
    if not (force and gap):
        return None
    return force["time"], (force[ENVIRONMENT] != 0).any(axis=1) & (gap[GAP] < 0)


def torques(
    results: Results, device: Device | None, user: str = ""
) -> tuple[Vector, Vector] | None:
    """Times (s) and torques (N.m) of the four motors of a user's device, None without one that is
    driven."""
    # casadi, which the terminal's lines, of the same module, can do without
    from hapticlink.components.device.torques import motor_torques

    motor, handle = of_user(MOTOR, user), of_user(HANDLE, user)
    table = of_block(results, motor, 3)
    if device is None or table is None or of_block(results, handle, 3) is not table:
        return None
    if not len(table["time"]):
        return None
    return table["time"], motor_torques(device, table[motor], table[handle])
