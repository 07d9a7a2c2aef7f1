"""Tracking error x_S - x_D between operational point and handle, and the frames in which the
graphics copy is folded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hapticlink.orchestrator.results.tables import Results, Table, Vector

MECHANISM, DEVICE = "virtual_mechanism.x", "haptic_device.x_true"
BRANCH = "virtual_environment.branch_ok"
POSE, SCALAR = (3,), ()
"""Shapes of a pose (m, m, rad), as of a wrench (N, N, N.m), and of a number."""


class Tracking(NamedTuple):
    """Distance |x_S - x_D| (mm) and angle |theta_S - theta_D| (rad) at times (s)."""

    time: Vector
    distance: Vector
    angle: Vector


def table_of(results: Results, signal: str, shape: tuple[int, ...] | None = None) -> Table | None:
    """The table that contains `signal`, whose rate depends on the scene; None if there is none, or
    if its values are not of `shape`: FMUs of others may have a block's name."""
    found = next((t for t in results.tables.values() if signal in t), None)
    return None if found and shape not in (None, found[signal].shape[1:]) else found


def has_tracking(results: Results) -> bool:
    """Whether a run has both an operational point and a handle."""
    return all(table_of(results, signal, POSE) for signal in (MECHANISM, DEVICE))


def pose_error(results: Results) -> Tracking:
    """Tracking error at the mechanism's samples up to the device's last one; the handle's pose is
    interpolated linearly where its clock differs. Raises KeyError without these signals."""
    mechanism, device = (table_of(results, s, POSE) for s in (MECHANISM, DEVICE))
    if mechanism is None or device is None:
        raise KeyError(f"tracking needs the signals {MECHANISM} and {DEVICE}")
    if not len(device["time"]):  # a fault before the first row
        return Tracking(*np.zeros((3, 0)))
    time = mechanism["time"]
    time = time[time <= device["time"][-1]]
    x, y, theta = (
        mechanism[MECHANISM][: len(time), i] - np.interp(time, device["time"], device[DEVICE][:, i])
        for i in range(3)
    )
    return Tracking(time, np.hypot(x, y) * 1e3, np.abs(theta))


def tracking(results: Results) -> tuple[Vector, Vector]:
    """Times (s) and distances |x_S - x_D| in the plane (mm). Raises KeyError without these
    signals."""
    time, distance, _ = pose_error(results)
    return time, distance


def folded(results: Results) -> tuple[int, int]:
    """Number of frames in which the graphics copy is on another assembly of its loops than the
    mechanism, and number of all frames; (0, 0) if the run has no such output."""
    table = table_of(results, BRANCH, SCALAR)
    if table is None:
        return 0, 0
    return int((table[BRANCH] == 0).sum()), len(table[BRANCH])
