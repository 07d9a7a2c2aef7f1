"""Tracking error x_S - x_D between operational point and handle, and the frames in which the
graphics copy is folded."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.rendered import recorded_handle
from hapticlink.components.dynamics.rendered_directions import rendered_directions
from hapticlink.components.port_space import PLANE, POINT, PortSpace
from hapticlink.orchestrator.base.signal_names import (
    APPLIED_TORQUES,
    BOARD_SENT_AT,
    CONSTRAINT_COUNTS,
    COPY_BRANCH_OK,
    DEVICE,
    DRIFT_WRENCH,
    ENVIRONMENT_WRENCH,
    HAND_WRENCH,
    HANDLE_POSE,
    HELD_POINT,
    MEASURED_HANDLE_POSES,
    MOTOR_WRENCH,
    PASSIVITY_DAMPING,
    PASSIVITY_ENERGY,
    POINT_PATH,
    POINT_POSE,
    TOPOLOGY_WRENCH,
    TORQUE_LIMITS,
    WORKSPACE_MARGIN,
    signal_of_user,
    user_of_block,
)
from hapticlink.orchestrator.results.html_table import html_table
from hapticlink.orchestrator.results.read_results import Results, Table, Vector


def rms(values: Vector) -> float:
    """The root mean square, without overflow of the squares."""
    largest = values.max()
    return float(largest * np.sqrt(np.mean((values / largest) ** 2))) if largest else 0.0


class Tracking(NamedTuple):
    """Distance |x_S - x_D| (mm) and angle |theta_S - theta_D| (rad), 0 in space, at times (s).
    Printed, and in a notebook, the largest and the root mean square of each."""

    time_s: Vector
    distance_mm: Vector
    angle_rad: Vector

    def _summary(self) -> Iterator[tuple[str, float, float, float]]:
        for name, values in (("distance (mm)", self.distance_mm), ("angle (rad)", self.angle_rad)):
            if len(values):
                at = int(np.argmax(values))
                yield name, float(values[at]), float(self.time_s[at]), rms(values)

    def __repr__(self) -> str:
        line = "{}: {:.4g} at most, at {:.4g} s, {:.4g} RMS"
        return "\n".join(line.format(*row) for row in self._summary()) or "no samples"

    def _repr_html_(self) -> str:
        return html_table(("", "at most", "at (s)", "RMS"), self._summary())


@dataclass(frozen=True)
class UserSignals:
    """The signals of a user, whose name is that of the point with the device, empty for the first
    user: poses of point and handle, wrenches, and what device and controller tell."""

    name: str
    point: str
    handle: str
    hand: str
    drift: str
    topology: str
    environment: str
    motors: str
    margin: str
    applied: str
    limits: str
    passivity_damping: str
    passivity_energy: str

    @classmethod
    def of(cls, name: str) -> UserSignals:
        """Those of a user with a name."""
        return cls(name, *(signal_of_user(signal, name) for signal in SIGNALS))

    @property
    def controller(self) -> str:
        return self.motors.partition(".")[0]

    @property
    def device(self) -> str:
        return self.handle.partition(".")[0]


SIGNALS = (
    POINT_POSE,
    HANDLE_POSE,
    HAND_WRENCH,
    DRIFT_WRENCH,
    TOPOLOGY_WRENCH,
    ENVIRONMENT_WRENCH,
    MOTOR_WRENCH,
    WORKSPACE_MARGIN,
    APPLIED_TORQUES,
    TORQUE_LIMITS,
    PASSIVITY_DAMPING,
    PASSIVITY_ENERGY,
)
"""Those of the first user, in the order of `UserSignals`."""
FIRST = UserSignals.of("")


def find_users(results: Results) -> list[UserSignals]:
    """The first user, and those beside it whose handle and point are recorded."""
    names = (name for fmu in results.record.fmus if (name := user_of_block(fmu, DEVICE)))
    further = (UserSignals.of(name) for name in names)
    return [FIRST, *(user for user in further if has_tracking(results, user))]


def table_of(results: Results, signal: str) -> Table | None:
    """The table that contains `signal`, whose rate depends on the scene; None if there is none. Of
    those with fewer rows than their rate has communication points by `record.signals`, none."""
    clocks = results.record.clocks
    return next((t for n, t in results.tables.items() if n in clocks and signal in t), None)


def of_block(results: Results, signal: str, *shape: int) -> Table | None:
    """As `of_any_shape`, where the signal has that shape."""
    table = of_any_shape(results, signal)
    return table if table and table.shape(signal) == shape else None


def of_port(results: Results, signal: str) -> Table | None:
    """As `of_any_shape`, of a pose or a wrench."""
    return of_block(results, signal, PLANE.size)


def space_of(results: Results) -> PortSpace:
    """That of the ports of a run, by the units of their third entries, which an SSP has, too."""
    of_point = {POINT_POSE: "m", HANDLE_POSE: "m", HAND_WRENCH: "N"}
    units = results.record.units
    return POINT if any(units.get(f"{s}[3]") == u for s, u in of_point.items()) else PLANE


def of_any_shape(results: Results, signal: str) -> Table | None:
    """The table that contains a signal of a block of the haptic loop, or of the FMU in its place;
    None for an FMU of others that only has the same name, of whose ports nothing is known."""
    name = signal.partition(".")[0]
    fmu = results.record.fmus.get(name)
    if fmu is None or not (name == fmu.block or name.startswith(f"{fmu.block}_")):
        return None
    return table_of(results, signal)


def have_one_shape(results: Results, *signals: str) -> bool:
    """Whether there are signals of the haptic loop, as efforts and displacements, of one shape."""
    tables = [of_any_shape(results, signal) for signal in signals]
    shapes = {table and table.shape(signal) for table, signal in zip(tables, signals, strict=True)}
    return all(tables) and len(shapes) == 1


def has_tracking(results: Results, user: UserSignals = FIRST) -> bool:
    """Whether there are the poses of a user's point and handle."""
    return all(of_port(results, s) for s in (user.point, find_handle(results, user)))


def find_handle(results: Results, user: UserSignals = FIRST) -> str:
    """The signal of the pose of a user's handle: the true one, of a board the measured one, as
    nobody knows another."""
    if of_any_shape(results, signal_of_user(BOARD_SENT_AT, user.name)):
        return find_measured_handle(results, user) or user.handle
    return user.handle


def pose_error(results: Results, user: UserSignals = FIRST) -> Tracking:
    """Tracking error of a user at the mechanism's samples up to the device's last one at which the
    hand holds a point; the handle's pose is interpolated linearly where its clock differs. Raises
    KeyError without these signals."""
    point, handle = user.point, find_handle(results, user)
    mechanism, device = of_port(results, point), of_port(results, handle)
    if mechanism is None or device is None:
        raise KeyError(f"tracking needs the signals {point} and {handle}")
    if not len(device["time"]):  # a fault before the first row
        return Tracking(*np.zeros((3, 0)))
    times, common, space = device["time"], compared_directions(results, user), space_of(results)
    together = (handle,) if mechanism is device else ()
    known = None if together else device[handle]

    def error(time: Vector, place: Vector, *held: Vector) -> Vector:
        if known is not None:
            held = (np.column_stack([np.interp(time, times, entry) for entry in known.T]),)
        apart = space.difference(place, *held)
        apart = apart if common is None else apart @ common
        return np.stack([space.distance(apart) * 1e3, space.angle(apart)])

    rows = rows_until(mechanism, times[-1])
    distance, angle = mechanism.by_row(error, "time", point, *together)
    found = [mechanism["time"][rows], distance[rows], angle[rows]]
    if user == FIRST and of_block(results, HELD_POINT) is mechanism:
        found = [each[mechanism[HELD_POINT][rows] > 0] for each in found]
    return Tracking(*found)


def compared_directions(results: Results, user: UserSignals = FIRST) -> Vector | None:
    """The projector (3, 3) on the directions in which a user's point and handle are compared: those
    that belong to both; None where all do."""
    rendered = rendered_directions(recorded_handle(results.record.scene, user.name))
    return None if rendered.whole else rendered.compared


def compares_angles(results: Results, user: UserSignals = FIRST) -> bool:
    """Whether an angle belongs to both a user's point and the handle."""
    turns, common = space_of(results).turns, compared_directions(results, user)
    return any(turns) and (common is None or bool(common.diagonal()[list(turns)].any()))


def path_of_point(results: Results, user: UserSignals) -> str:
    """The signal with which wrenches at a user's point are paired for their work."""
    changes = user == FIRST and of_port(results, POINT_PATH) is not None
    return POINT_PATH if changes else user.point


def newest(table: Table, times: float | Vector) -> NDArray[np.intp]:
    """The newest row at each of the times (s); the first one before it."""
    return np.maximum(np.searchsorted(table["time"], times + 1e-12, "right") - 1, 0)


def rows_until(table: Table, time: float) -> slice:
    """The rows of a table up to a time (s)."""
    return slice(0, int(np.searchsorted(table["time"], time, "right")))


def tracking(results: Results) -> tuple[Vector, Vector]:
    """Times (s) and distances |x_S - x_D| (mm). Raises KeyError without these signals."""
    time, distance, _ = pose_error(results)
    return time, distance


def count_constrained(results: Results) -> tuple[Vector, Vector] | None:
    """Times (s) and numbers of constrained directions, at the rate of the block that the controller
    gets them from; None where there are none."""
    for signal in CONSTRAINT_COUNTS:
        if table := of_block(results, signal):
            return table["time"], table[signal]
    return None


def find_measured_handle(results: Results, user: UserSignals) -> str | None:
    """The signal of the pose of a user's handle as it is measured, by the observer where one is
    beside the device; None where there is none."""
    signals = (signal_of_user(signal, user.name) for signal in MEASURED_HANDLE_POSES)
    return next((signal for signal in signals if of_port(results, signal)), None)


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
