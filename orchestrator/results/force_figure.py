"""Forces, moments and motor torques of a haptic run over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.results.figure_axes import legend_above_curves, short, titled
from hapticlink.orchestrator.results.tables import Results, Vector
from hapticlink.orchestrator.results.tracking import of_block

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
MOTOR, HANDLE = "controller.F_motor", "haptic_device.x"


def wrenches(results: Results) -> dict[str, tuple[Vector, Vector, Vector]]:
    """By name: times (s), force (N) and moment (N.m) of each wrench that the run has."""
    found = {}
    for signal, name in WRENCHES.items():
        if (table := of_block(results, signal, 3)) and len(table["time"]):
            F = table[signal]
            found[name] = table["time"], np.hypot(F[:, 0], F[:, 1]), F[:, 2]
    return found


def touching(results: Results) -> tuple[Vector, NDArray[np.bool_]] | None:
    """Times (s), and whether contacts push then; None without contacts. F_env alone does not tell:
    it has other hands and efforts on joints, too."""
    force, gap = of_block(results, ENVIRONMENT, 3), of_block(results, GAP)
    if not (force and gap):
        return None
    return force["time"], (force[ENVIRONMENT] != 0).any(axis=1) & (gap[GAP] < 0)


def torques(results: Results, device: Device | None) -> tuple[Vector, Vector] | None:
    """Times (s) and torques (N.m) of the four motors, None without a device that is driven."""
    # casadi, which the terminal's lines, of the same module, can do without
    from hapticlink.components.device.torques import motor_torques

    table = of_block(results, MOTOR, 3)
    if device is None or table is None or of_block(results, HANDLE, 3) is not table:
        return None
    if not len(table["time"]):
        return None
    return table["time"], motor_torques(device, table[MOTOR], table[HANDLE])


def forces(results: Results, device: Device | None) -> Figure:
    """Forces, moments and, against their limit, motor torques of a run that has wrenches."""
    found, driven = wrenches(results), torques(results, device)
    largest, (_, force, _) = max(found.items(), key=lambda item: item[1][1].max())
    title = f"The largest force is that of the {largest}: {short(force.max())} N"
    labels = ["force (N)", "moment (N.m)", *(["motor torque (N.m)"] if driven else [])]
    if driven and device:
        share = 100 * np.abs(driven[1]).max() / device.torque_limit
        title += f"; motors reach {short(share)} % of their torque limit"
    figure, axes = titled(results, title, "time (s)", *labels)
    for name, (time, force, moment) in found.items():
        axes[0].plot(time, force, lw=1, label=name)
        axes[1].plot(time, moment, lw=1)
    legend_above_curves(axes[0], columns=2)
    if driven and device:
        axes[2].plot(driven[0], driven[1], lw=1, label=[f"motor {i}" for i in (1, 2, 3, 4)])
        for limit in (-device.torque_limit, device.torque_limit):
            label = "limit" if limit > 0 else None
            axes[2].axhline(limit, color="k", lw=0.8, ls="--", label=label)
        legend_above_curves(axes[2], columns=5)
    return figure
