"""Tracking error x_S - x_D between operational point and handle, and the frames in which the
graphics copy is folded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hapticlink.orchestrator.results.tables import Results, Table, Vector

MECHANISM, DEVICE = "virtual_mechanism.x", "haptic_device.x_true"
BRANCH = "virtual_environment.branch_ok"
COUNTS = ("virtual_environment.n_constraints", "virtual_mechanism.n_constraints")


class Tracking(NamedTuple):
    """Distance |x_S - x_D| (mm) and angle |theta_S - theta_D| (rad) at times (s)."""

    time_s: Vector
    distance_mm: Vector
    angle_rad: Vector


def further_users(results: Results) -> list[str]:
    """The points at which users beside the first one hold a device."""
    named = (n.partition("haptic_device_")[2] for n in results.record.fmus)
    return [n for n in named if n and all(of_block(results, signal, 3) for signal in poses(n))]


def poses(user: str = "") -> tuple[str, str]:
    """The poses of a user's point and handle; the first user's name is empty."""
    return of_user(MECHANISM, user), of_user(DEVICE, user)


def of_user(signal: str, user: str) -> str:
    """A first user's signal as that of another one, by the point's name: controller_left.F_drift,
    virtual_mechanism.left.F_env."""
    block, _, port = signal.partition(".")
    if not user:
        return signal
    return f"{block}.{user}.{port}" if block == "virtual_mechanism" else f"{block}_{user}.{port}"


def table_of(results: Results, signal: str) -> Table | None:
    """The table that contains `signal`, whose rate depends on the scene; None if there is none."""
    return next((t for t in results.tables.values() if signal in t), None)


def of_block(results: Results, signal: str, *shape: int) -> Table | None:
    """As `of_any_shape`, where the signal has that shape."""
    table = of_any_shape(results, signal)
    return table if table and table[signal].shape[1:] == shape else None


def of_any_shape(results: Results, signal: str) -> Table | None:
    """The table that contains a signal of a block of the haptic loop, or of the FMU in its place;
    None for an FMU of others that only has the same name, of whose ports nothing is known."""
    name = signal.partition(".")[0]
    fmu = results.record.fmus.get(name)
    if fmu is None or not (name == fmu.block or name.startswith(f"{fmu.block}_")):
        return None
    return table_of(results, signal)


def has_tracking(results: Results) -> bool:
    return all(of_block(results, signal, 3) for signal in (MECHANISM, DEVICE))


def pose_error(results: Results, user: str = "") -> Tracking:
    """Tracking error of a user at the mechanism's samples up to the device's last one; the handle's
    pose is interpolated linearly where its clock differs. Raises KeyError without these signals."""
    point, handle = poses(user)
    mechanism, device = of_block(results, point, 3), of_block(results, handle, 3)
    if mechanism is None or device is None:
        raise KeyError(f"tracking needs the signals {point} and {handle}")
    if not len(device["time"]):  # a fault before the first row
        return Tracking(*np.zeros((3, 0)))
    time = mechanism["time"]
    time = time[time <= device["time"][-1]]
    x, y, theta = (
        mechanism[point][: len(time), i] - np.interp(time, device["time"], device[handle][:, i])
        for i in range(3)
    )
    return Tracking(time, np.hypot(x, y) * 1e3, np.abs(theta))


def tracking(results: Results) -> tuple[Vector, Vector]:
    """Times (s) and distances |x_S - x_D| in the plane (mm). Raises KeyError without these
    signals."""
    time, distance, _ = pose_error(results)
    return time, distance


def constrained(results: Results) -> tuple[Table, str] | None:
    """The table with the number of constrained directions, at the rate of the block that the
    controller gets it from, and the signal's name; None where there is none."""
    for signal in COUNTS:
        if table := of_block(results, signal):
            return table, signal
    return None


def folded(results: Results) -> tuple[int, int]:
    """Number of frames in which the graphics copy is on another assembly of its loops than the
    mechanism, and number of all frames; (0, 0) if the run has no such output."""
    table = of_block(results, BRANCH)
    if table is None:
        return 0, 0
    return int((table[BRANCH] == 0).sum()), len(table[BRANCH])
