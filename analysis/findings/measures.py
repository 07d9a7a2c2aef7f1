"""What is measured of a run: the numbers of terminal, sweeps, comparisons, tuning and API."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hapticlink.analysis.findings.episodes import Episode, saturations
from hapticlink.analysis.findings.forces import motor_loads, wrenches
from hapticlink.analysis.findings.noticed import noticed
from hapticlink.analysis.findings.tracking import (
    UserSignals,
    constraint_counts,
    count_constrained,
    count_folded,
    find_users,
    has_tracking,
    of_block,
    pose_error,
    rms,
)
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.orchestrator.base.signal_names import CLOSURE_ERROR
from hapticlink.orchestrator.results.read_results import Results, Vector
from hapticlink.orchestrator.results.recorded_scene import all_devices
from hapticlink.orchestrator.results.run_record import Energy, HeldContacts, Noticed, PortEnergy


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
    until a time (s). What a scene does not have, or does not record, is missing or None. works:
    whether `port` has those of single wrenches and of the hands."""

    def __init__(self, results: Results, until: float = math.inf, works: bool = True) -> None:
        self._results, self._until, self._works = results, until + 1e-12, works

    def _within(self, times: Vector, values: Vector) -> Vector:
        """Values until the time."""
        return values[: np.searchsorted(times, self._until, "right")]

    @cached_property
    def tracking(self) -> dict[str, TrackingError]:
        """By the users' names; that of the first one is empty."""
        found = {}
        users = (u for u in find_users(self._results) if has_tracking(self._results, u))
        for user in users:
            error = pose_error(self._results, user)
            time, mm, rad = (self._within(error.time_s, each) for each in error)
            if len(time):
                worst = float(mm.max()), float(rms(mm)), float(rad.max()), float(rms(rad))
                found[user.name] = TrackingError(*worst, float(time[-1]))
        return found

    @cached_property
    def forces(self) -> dict[str, float]:
        """The largest force (N) of each wrench."""
        each = ((name, self._within(*sizes)) for name, *sizes, _ in wrenches(self._results))
        return {name: float(within.max()) for name, within in each if len(within)}

    @cached_property
    def motors(self) -> dict[str, float]:
        """The largest motor torque of each user as a share of the torque limit."""
        devices = all_devices(self._results).items()
        loads = ((u, motor_loads(self._results, d, UserSignals.of(u))) for u, d in devices)
        return {u: float(self._within(*of).max(initial=0.0)) for u, of in loads if of}

    @cached_property
    def saturations(self) -> list[Episode]:
        """When motors were at their limit, in the whole run."""
        return saturations(self._results)

    @cached_property
    def closure_m(self) -> float | None:
        """The largest closure error of the mechanism's loops (m)."""
        table = of_block(self._results, CLOSURE_ERROR)
        if table is None or not len(table["time"]):
            return None
        errors = self._within(table["time"], table[CLOSURE_ERROR])
        return float(np.abs(errors).max(initial=0.0))

    @cached_property
    def constrained(self) -> Constrained | None:
        """The numbers of constrained directions."""
        if (counted := count_constrained(self._results)) is None:
            return None
        numbers = self._within(*counted)
        switches = int(np.count_nonzero(np.diff(numbers)))
        return Constrained(constraint_counts(numbers), switches)

    @cached_property
    def folded(self) -> tuple[int, int]:
        """The frames of the whole run in which the graphics copy is folded, and all frames."""
        return count_folded(self._results)

    @cached_property
    def port(self) -> PortEnergy | None:
        """The energy generated at the user's port in the whole run."""
        port = user_port(self._results, self._works)
        return port.measured if port and len(port.time_s) else None

    @cached_property
    def held_contacts(self) -> HeldContacts | None:
        """What new frames of contacts did to the mechanism in the whole run."""
        if not self._results.record.scene["contacts"]:
            return None
        from hapticlink.analysis.findings import held_contacts  # casadi

        return held_contacts.held_contacts(self._results)

    @cached_property
    def noticed(self) -> dict[str, Noticed]:
        """What the hands of users with a device would notice in the whole run."""
        return noticed(self._results)

    @cached_property
    def held(self) -> dict[str, Energy]:
        """The energies of the connections with a hold, in the whole run."""
        record = self._results.record
        return {name: record.meters[name] for name in record.holds if name in record.meters}
