"""Tracking error x_S - x_D between operational point and handle, and the frames in which the
graphics copy is folded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hapticlink.components.port_space import PLANE
from hapticlink.orchestrator.base.signal_names import (
    CONSTRAINT_COUNTS,
    COPY_BRANCH_OK,
    DEVICE,
    HANDLE_POSE,
    POINT_POSE,
    signal_of_user,
    user_of_block,
)
from hapticlink.orchestrator.results.read_results import Results, Table, Vector


class Tracking(NamedTuple):
    """Distance |x_S - x_D| (mm) and angle |theta_S - theta_D| (rad) at times (s)."""

    time_s: Vector
    distance_mm: Vector
    angle_rad: Vector


def further_users(results: Results) -> list[str]:
    """The points at which users beside the first one hold a device."""
    users = [u for name in results.record.fmus if (u := user_of_block(name, DEVICE))]
    return [u for u in users if has_tracking(results, u)]


def poses(user: str = "") -> tuple[str, str]:
    """The poses of a user's point and handle; the first user's name is empty."""
    return signal_of_user(POINT_POSE, user), signal_of_user(HANDLE_POSE, user)


def table_of(results: Results, signal: str) -> Table | None:
    """The table that contains `signal`, whose rate depends on the scene; None if there is none."""
    return next((t for t in results.tables.values() if signal in t), None)


def of_block(results: Results, signal: str, *shape: int) -> Table | None:
    """As `of_any_shape`, where the signal has that shape."""
    table = of_any_shape(results, signal)
    return table if table and table.shape(signal) == shape else None


def of_any_shape(results: Results, signal: str) -> Table | None:
    """The table that contains a signal of a block of the haptic loop, or of the FMU in its place;
    None for an FMU of others that only has the same name, of whose ports nothing is known."""
    name = signal.partition(".")[0]
    fmu = results.record.fmus.get(name)
    if fmu is None or not (name == fmu.block or name.startswith(f"{fmu.block}_")):
        return None
    return table_of(results, signal)


def has_tracking(results: Results, user: str = "") -> bool:
    """Whether there are the poses of a user's point and handle."""
    return all(of_block(results, signal, 3) for signal in poses(user))


def pose_error(results: Results, user: str = "") -> Tracking:
    """Tracking error of a user at the mechanism's samples up to the device's last one; the handle's
    pose is interpolated linearly where its clock differs. Raises KeyError without these signals."""
    point, handle = poses(user)
    mechanism, device = of_block(results, point, 3), of_block(results, handle, 3)
    if mechanism is None or device is None:
        raise KeyError(f"tracking needs the signals {point} and {handle}")
    if not len(device["time"]):  # a fault before the first row
        return Tracking(*np.zeros((3, 0)))
    times, known = device["time"], device[handle]

    def error(time: Vector, place: Vector) -> Vector:
        held = np.column_stack([np.interp(time, times, entry) for entry in known.T])
        apart = PLANE.difference(place, held)
        return np.stack([PLANE.distance(apart) * 1e3, PLANE.angle(apart)])

    rows = rows_until(mechanism, times[-1])
    distance, angle = mechanism.by_row(error, "time", point)
    return Tracking(mechanism["time"][rows], distance[rows], angle[rows])


def rows_until(table: Table, time: float) -> slice:
    """The rows of a table up to a time (s)."""
    return slice(0, int(np.searchsorted(table["time"], time, "right")))


def tracking(results: Results) -> tuple[Vector, Vector]:
    """Times (s) and distances |x_S - x_D| in the plane (mm). Raises KeyError without these
    signals."""
    time, distance, _ = pose_error(results)
    return time, distance


def count_constrained(results: Results) -> tuple[Vector, Vector] | None:
    """Times (s) and numbers of constrained directions, at the rate of the block that the controller
    gets them from; None where there are none."""
    for signal in CONSTRAINT_COUNTS:
        if table := of_block(results, signal):
            return table["time"], table[signal]
    return None


def constraint_counts(numbers: Vector) -> dict[float, int]:
    """The samples with each number of constrained directions, by number."""
    found = zip(*np.unique(numbers, return_counts=True), strict=True)
    return {float(number): int(samples) for number, samples in found}


def count_folded(results: Results) -> tuple[int, int]:
    """Number of frames in which the graphics copy is on another assembly of its loops than the
    mechanism, and number of all frames; (0, 0) if the run has no such output."""
    table = of_block(results, COPY_BRANCH_OK)
    kept = table[COPY_BRANCH_OK] if table else np.zeros(0)
    return int((kept == 0).sum()), len(kept)
