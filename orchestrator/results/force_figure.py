"""Forces, moments and motor torques of a haptic run over time."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.results.figure_axes import legend_above_curves, short, titled
from hapticlink.orchestrator.results.tables import Results, Vector
from hapticlink.orchestrator.results.tracking import further_users, of_block, of_user

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WRENCHES = {
    "hand.F": "hand, F_hand",
    "controller.F_drift": "virtual coupling, F_drift",
    "controller.F_constraint": "topology controller, F_T",
    "virtual_mechanism.F_env": "contacts and other hands, F_env",
}
"""By signal, what it is called; each is (N, N, N.m)."""
ENVIRONMENT, GAP = "virtual_mechanism.F_env", "virtual_mechanism.contact_gap"
STYLES = ("-", "--", ":", "-.")
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


def forces(results: Results, devices: Mapping[str, Device]) -> Figure:
    """Forces, moments and, against their limits, motor torques of a run that has wrenches.
    devices: of each user by point; the first one's name is empty. Further users are dashed."""
    found = all_wrenches(results)
    driven = {
        user: (*moved, device.torque_limit)
        for user, device in devices.items()
        if (moved := torques(results, device, user))
    }
    largest, (_, force, _) = max(found.items(), key=lambda item: item[1][1].max())
    title = f"The largest force is that of the {largest}: {short(force.max())} N"
    labels = ["force (N)", "moment (N.m)", *(["motor torque (N.m)"] if driven else [])]
    if driven:
        share = 100 * max(np.abs(tau).max() / limit for _, tau, limit in driven.values())
        title += f"; motors reach {short(share)} % of their torque limit"
    figure, axes = titled(results, title, "time (s)", *labels)
    styles = dict(zip(["", *further_users(results)], cycle(STYLES)))
    names = [*WRENCHES.values()]
    for name, (time, force, moment) in found.items():
        user, _, kind = name.rpartition(": ")
        look = {"lw": 1, "color": f"C{names.index(kind)}", "ls": styles[user]}
        axes[0].plot(time, force, label=name, **look)
        axes[1].plot(time, moment, **look)
    legend_above_curves(axes[0], columns=2)
    for user, (time, tau, limit) in driven.items():
        for i, each in enumerate(tau.T):
            said = None if user else f"motor {i + 1}"
            axes[2].plot(time, each, lw=1, color=f"C{i}", ls=styles[user], label=said)
        for sign in (-1, 1):
            said = None if user or sign < 0 else "limit"
            axes[2].axhline(sign * limit, color="k", lw=0.8, ls="--", label=said)
    if driven:
        legend_above_curves(axes[2], columns=5)
    return figure
