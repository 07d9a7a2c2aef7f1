"""Forces, moments and motor torques of a haptic run over time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import groupby, repeat

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.tracking import (
    UserSignals,
    find_measured_handle,
    find_users,
    of_any_shape,
    of_block,
    of_port,
    space_of,
)
from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.base.signal_names import (
    CONTACT_GAP,
    DRIFT_WRENCH,
    ENVIRONMENT_WRENCH,
    HAND_WRENCH,
    TOPOLOGY_WRENCH,
    signal_of_user,
)
from hapticlink.orchestrator.results.read_results import Results, Vector
from hapticlink.orchestrator.results.recorded_scene import described_devices

WRENCHES = {
    HAND_WRENCH: "hand, F_hand",
    DRIFT_WRENCH: "virtual coupling, F_drift",
    TOPOLOGY_WRENCH: "topology controller, F_T",
    ENVIRONMENT_WRENCH: "contacts and other hands, F_env",
}
"""By signal, what it is called; each is (N, N, N.m)."""


def wrenches(results: Results) -> Iterator[tuple[str, Vector, Vector, Vector]]:
    """Name, times (s), force (N) and moment (N.m), 0 in space, of each wrench that a run has; names
    of further users' wrenches have their point first."""
    space = space_of(results)
    sizes = space.distance, space.moment
    found = [
        (table, signal, f"{user.name}: {name}" if user.name else name)
        for user in find_users(results)
        for first, name in WRENCHES.items()
        if (table := of_port(results, signal := signal_of_user(first, user.name)))
        and len(table["time"])
    ]
    for _, each in groupby(found, lambda one: id(one[0])):
        (table, *_), signals, names = zip(*each, strict=True)
        rows = table.by_row(lambda *F: np.stack([of(f) for f in F for of in sizes]), *signals)
        yield from zip(names, repeat(table["time"]), rows[::2], rows[1::2], strict=False)


def touching(results: Results) -> tuple[Vector, NDArray[np.bool_]] | None:
    """Times (s), and whether contacts push then; None without contacts. F_env alone does not tell:
    it has other hands and efforts on joints, too."""
    force, gap = of_port(results, ENVIRONMENT_WRENCH), of_block(results, CONTACT_GAP)
    if not (force and gap):
        return None
    largest = force.by_row(lambda F: np.abs(F).max(axis=1), ENVIRONMENT_WRENCH)
    return force["time"], (largest != 0) & (gap[CONTACT_GAP] < 0)


def torques(
    results: Results,
    device: Device | None,
    user: UserSignals,
    of_motors: Callable[[Vector], Vector] = np.transpose,
) -> tuple[Vector, Vector] | None:
    """Times (s) and torques (N.m) of the motors of a user's device, (m, n), or what a function
    gives of those at a number of times, (n, m); None without a device that is driven.

    A device's FMU from elsewhere tells its torques itself, by an output `tau_applied`.
    """
    # casadi, which the terminal's lines, of the same module, can do without
    from hapticlink.components.device.motors_and_encoders import motor_torques

    if device is None:
        return None
    if user.name not in described_devices(results):
        given = of_any_shape(results, user.applied)
        if given is None or not len(given["time"]):
            return None
        return given["time"], given.by_row(of_motors, user.applied)
    table, handle = of_port(results, user.motors), find_measured_handle(results, user)
    if table is None or handle is None or of_port(results, handle) is not table:
        return None
    if not len(table["time"]):
        return None
    return table["time"], table.by_row(
        lambda F, x: of_motors(motor_torques(device, F, x)), user.motors, handle
    )


def motor_loads(
    results: Results, device: Device, user: UserSignals
) -> tuple[Vector, Vector] | None:
    """Times (s), and the largest torque of a user's motors by its limit; None where no torques or
    no limits are known."""
    limits = torque_limits(results, device, user)
    if limits is None:
        return None

    def largest(of_motors: Vector) -> Vector:
        loads: Vector = (np.abs(of_motors) / limits).max(axis=1)
        return loads

    return torques(results, device, user, largest)


def torque_limits(results: Results, device: Device, user: UserSignals) -> Vector | None:
    """The limits (N.m) of a user's motors, (m,): those of [device]; of an FMU from elsewhere those
    that its output `torque_limit` has at the start."""
    if user.name in described_devices(results):
        return np.array([motor.torque_limit for motor in device.motors])
    table = of_any_shape(results, user.limits)
    return None if table is None or not len(table["time"]) else np.atleast_1d(table[user.limits][0])
