"""What is measured of a run: the numbers of terminal, sweeps, comparisons, tuning and API."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hapticlink.analysis.findings.forces import all_wrenches, torques
from hapticlink.analysis.findings.tracking import (
    constrained,
    folded,
    further_users,
    of_block,
    pose_error,
    poses,
)
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.orchestrator.base.loop_names import CLOSURE_ERROR
from hapticlink.orchestrator.results.run_record import Energy, PortEnergy
from hapticlink.orchestrator.results.scene_part import all_devices
from hapticlink.orchestrator.results.tables import Results, Vector


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
    """The measures of a run, each computed when it is asked for; those of paths, forces and torques
    until a time (s). What a scene does not have, or does not record, is missing or None."""

    def __init__(self, results: Results, until: float = math.inf) -> None:
        self._results, self._until = results, until + 1e-12

    @cached_property
    def tracking(self) -> dict[str, TrackingError]:
        """By the users' names; that of the first one is empty."""
        errors = {}
        for user in ("", *further_users(self._results)):
            if not all(of_block(self._results, pose, 3) for pose in poses(user)):
                continue
            error = pose_error(self._results, user)
            count = int(np.count_nonzero(error.time_s <= self._until))
            if count:
                distance, angle = error.distance_mm[:count], error.angle_rad[:count]
                errors[user] = TrackingError(
                    float(distance.max()),
                    rms(distance),
                    float(angle.max()),
                    rms(angle),
                    float(error.time_s[count - 1]),
                )
        return errors

    @cached_property
    def forces(self) -> dict[str, float]:
        """The largest force (N) of each wrench."""
        every = all_wrenches(self._results).items()
        acting = {name: force[time <= self._until] for name, (time, force, _) in every}
        return {name: float(force.max()) for name, force in acting.items() if len(force)}

    @cached_property
    def motors(self) -> dict[str, float]:
        """The largest motor torque of each user as a share of the torque limit."""
        shares = {}
        for user, device in all_devices(self._results).items():
            if driven := torques(self._results, device, user):
                time, torque = driven
                largest = np.abs(torque[time <= self._until]).max(initial=0.0)
                shares[user] = float(largest) / device.torque_limit
        return shares

    @cached_property
    def closure_m(self) -> float | None:
        """The largest closure error of the mechanism's loops (m)."""
        table = of_block(self._results, CLOSURE_ERROR)
        if table is None or not len(table["time"]):
            return None
        return float(np.abs(table[CLOSURE_ERROR][table["time"] <= self._until]).max(initial=0.0))

    @cached_property
    def constrained(self) -> Constrained | None:
        """The numbers of constrained directions."""
        if (counted := constrained(self._results)) is None:
            return None
        table, signal = counted
        count = table[signal][table["time"] <= self._until]
        numbers, samples = np.unique(count, return_counts=True)
        by_number = dict(zip(numbers.tolist(), samples.tolist(), strict=True))
        return Constrained(by_number, int(np.count_nonzero(np.diff(count))))

    @cached_property
    def folded(self) -> tuple[int, int]:
        """The frames of the whole run in which the graphics copy is folded, and all frames."""
        return folded(self._results)

    @cached_property
    def port(self) -> PortEnergy | None:
        """The energy generated at the user's port in the whole run."""
        energy = user_port(self._results)
        return energy and energy.measured

    @cached_property
    def held(self) -> dict[str, Energy]:
        """The energies of the connections with a hold, in the whole run."""
        record = self._results.record
        return {name: record.meters[name] for name in record.holds if name in record.meters}


def rms(values: Vector) -> float:
    """The root mean square, without overflow of the squares."""
    largest = values.max()
    return float(largest * np.sqrt(np.mean((values / largest) ** 2))) if largest else 0.0
