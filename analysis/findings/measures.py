"""What is measured of a run: the numbers of terminal, sweeps, comparisons, tuning and API."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hapticlink.analysis.findings.episodes import Episode, saturations
from hapticlink.analysis.findings.forces import all_wrenches, torques
from hapticlink.analysis.findings.tracking import (
    constrained,
    constraint_counts,
    folded,
    further_users,
    of_block,
    pose_error,
    poses,
)
from hapticlink.analysis.findings.user_port import measured, ports
from hapticlink.orchestrator.base.signal_names import CLOSURE_ERROR
from hapticlink.orchestrator.results.read_results import Results, Vector
from hapticlink.orchestrator.results.recorded_scene import all_devices
from hapticlink.orchestrator.results.run_record import Energy, PortEnergy
from hapticlink.orchestrator.results.windows import until


class TrackingError(NamedTuple):
    """The tracking error between handle and operational point, until its last sample `end_s`."""

    max_mm: float
    rms_mm: float
    max_rad: float
    rms_rad: float
    end_s: float


class Constrained(NamedTuple):
    """Number of samples by their number of constrained directions, and how often this changes."""

    samples: dict[float, int]
    switches: int

    @property
    def shares_percent(self) -> dict[float, float]:
        """The share of the samples with each number of constrained directions."""
        every = sum(self.samples.values())
        return {number: 100 * (count / every) for number, count in self.samples.items()}

    @property
    def more_percent(self) -> float:
        """The share of the samples with more directions than the fewest of the run."""
        every = sum(self.samples.values())
        return 100 * ((every - self.samples[min(self.samples)]) / every) if every else 0.0


class Measures:
    """The measures of a run, each computed when it is asked for, window by window; those of paths,
    forces and torques until a time (s). What a scene does not have, or does not record, is missing
    or None."""

    def __init__(self, results: Results, until: float = math.inf) -> None:
        self._results, self._until = results, until + 1e-12

    def _windows(self) -> Iterator[Results]:
        return until(self._results, self._until)

    @cached_property
    def tracking(self) -> dict[str, TrackingError]:
        """By the users' names; that of the first one is empty."""
        parts: dict[str, list[tuple[float, ...]]] = {}
        for window in self._windows():
            for user in ("", *further_users(window)):
                if not all(of_block(window, pose, 3) for pose in poses(user)):
                    continue
                error = pose_error(window, user)
                if len(error.time_s):
                    distance, angle = error.distance_mm, error.angle_rad
                    part = (distance.max(), rms(distance), angle.max(), rms(angle))
                    parts.setdefault(user, []).append((*part, error.time_s[-1], len(distance)))
        return {user: _joined(np.array(each)) for user, each in parts.items()}

    @cached_property
    def forces(self) -> dict[str, float]:
        """The largest force (N) of each wrench."""
        return _largest(
            {name: force for name, (_, force, _) in all_wrenches(window).items() if len(force)}
            for window in self._windows()
        )

    @cached_property
    def motors(self) -> dict[str, float]:
        """The largest motor torque of each user as a share of the torque limit."""
        devices = all_devices(self._results)
        return _largest(
            {
                user: np.abs(driven[1]) / device.torque_limit
                for user, device in devices.items()
                if (driven := torques(window, device, user))
            }
            for window in self._windows()
        )

    @cached_property
    def saturations(self) -> list[Episode]:
        """When motors were at their limit, in the whole run."""
        return saturations(self._results)

    @cached_property
    def closure_m(self) -> float | None:
        """The largest closure error of the mechanism's loops (m)."""
        errors = (
            {"": np.abs(table[CLOSURE_ERROR][window.within(table["time"])])}
            for window in self._windows()
            if (table := of_block(window, CLOSURE_ERROR)) and len(table["time"])
        )
        return _largest(errors).get("")

    @cached_property
    def constrained(self) -> Constrained | None:
        """The numbers of constrained directions."""
        switches, last = None, np.zeros(0)
        for window in self._windows():
            if counted := constrained(window):
                table, signal = counted
                count = table[signal][window.within(table["time"])]
                changes = np.diff(np.concatenate([last, count]))
                switches = (switches or 0) + int(np.count_nonzero(changes))
                last = count[-1:] if len(count) else last
        if switches is None:
            return None
        return Constrained(constraint_counts(self._windows()), switches)

    @cached_property
    def folded(self) -> tuple[int, int]:
        """The frames of the whole run in which the graphics copy is folded, and all frames."""
        return folded(self._results)

    @cached_property
    def port(self) -> PortEnergy | None:
        """The energy generated at the user's port in the whole run."""
        return measured(ports(self._results))

    @cached_property
    def held(self) -> dict[str, Energy]:
        """The energies of the connections with a hold, in the whole run."""
        record = self._results.record
        return {name: record.meters[name] for name in record.holds if name in record.meters}


def _largest(windows: Iterable[Mapping[str, Vector]]) -> dict[str, float]:
    """By name, the largest of values that are 0 or more."""
    found: dict[str, float] = {}
    for window in windows:
        for name, values in window.items():
            found[name] = max(float(values.max(initial=0.0)), found.get(name, 0.0))
    return found


def _joined(parts: Vector) -> TrackingError:
    """Of windows, rows of largest, RMS (mm), largest, RMS (rad), last time (s), samples."""
    shares = parts[:, 5] / parts[:, 5].sum()
    (mm, angle) = (
        float(parts[0, i] if len(parts) == 1 else np.sqrt(shares @ parts[:, i] ** 2))
        for i in (1, 3)
    )
    largest = parts.max(axis=0)
    return TrackingError(float(largest[0]), mm, float(largest[2]), angle, float(parts[-1, 4]))


def rms(values: Vector) -> float:
    """The root mean square, without overflow of the squares."""
    largest = values.max()
    return float(largest * np.sqrt(np.mean((values / largest) ** 2))) if largest else 0.0
