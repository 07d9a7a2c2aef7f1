"""What a run must keep so that its gains, its hold or its rates can be advised.

Absolute limits, which hold for every scene:

1. The run has no fault and lasts as long as the scene.
2. The handle leaves the operational point by less than DISTANCE of the device's workspace, the
   smaller side of what it reaches at every angle, and turns away from it by less than TURN.
3. The user's port generates at most a quarter of the hand's absolute work, or 1 mJ
   (`findings/user_port.py`).

And relative ones, beside a run whose setting is to be improved: its tracking error may grow by
TRACKED, and it may end as early. They are taken only from a run that keeps the absolute ones: what
is wild is no measure.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

from hapticlink.analysis.findings.user_port import hand_work, tolerated_energy
from hapticlink.analysis.sweep.row import METRIC, Row, of_results
from hapticlink.components.device.workspace import workspace
from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.scene.scene import Scene

DISTANCE = 0.2
"""Of the workspace, from which on a tracking error (m) counts as unstable."""
TURN = 1.0
"""The same of an angle (rad)."""
TRACKED = 1.2
"""Largest tracking error beside that of another run."""
PEAK, WORK = "port_peak_J", "hand_work_J"
ENDS = ("duration", "stop_when")
"""In good order."""


def judged_numbers(run: Results) -> Row:
    """The numbers of a run, with all that `AcceptanceLimits` judge."""
    return of_results(run) | {WORK: hand_work(run)}


def broken_limit(read: Scene, run: Results) -> str:
    """Which absolute limit a run of a scene breaks, "" where it keeps all, or has no device that
    follows a point."""
    if read.device is None or METRIC not in (row := judged_numbers(run)):
        return ""
    return AcceptanceLimits.of(read.device).why_not(row)


@dataclass(frozen=True)
class AcceptanceLimits:
    """Largest tracking error (mm, rad), and the least time (s) that a run lasts, infinite for the
    duration of its scene."""

    distance_mm: float
    turn_rad: float = TURN
    lasts_s: float = math.inf

    @classmethod
    def of(cls, device: Device) -> AcceptanceLimits:
        """The absolute ones of a device."""
        return cls(1e3 * DISTANCE * _smaller_side(device))

    def beside(self, row: Row) -> tuple[AcceptanceLimits, str]:
        """These with those relative to a run, which may end early in good order; or these alone,
        and which of them that run breaks."""
        if broken := replace(self, lasts_s=0.0).why_not(row):
            return self, broken
        near = min(self.distance_mm, TRACKED * row[METRIC])
        return replace(self, distance_mm=near, lasts_s=_lasted(row)), ""

    def why_not(self, row: Row) -> str:
        """The first limit that a run breaks, "" where it keeps all."""
        return next(self._broken(row), "")

    def _broken(self, row: Row) -> Iterator[str]:
        if row["end"] not in ENDS:
            yield f"the run ends by {row['end']}: {row['message']}"
        if METRIC not in row:
            yield "the run has no tracking error"
            return
        if _lasted(row) < self.lasts_s:
            yield f"the run ends after {row['end_time_s']:g} s"
        if not row[METRIC] <= self.distance_mm:
            yield (
                f"the handle leaves its point by {short(row[METRIC])} mm, and may by "
                f"{short(self.distance_mm)}"
            )
        if not row["theta_max_rad"] <= self.turn_rad:
            yield (
                f"the handle turns away from its point by {short(row['theta_max_rad'])} rad, and "
                f"may by {short(self.turn_rad)}"
            )
        if energy_share(row) > 1.0:
            yield (
                f"the user's port gives {short(1e3 * row[PEAK])} mJ, and may "
                f"{short(1e3 * tolerated_energy(row[WORK]))}"
            )


def energy_share(row: Row) -> float:
    """The largest energy generated at the user's port, relative to what is allowed."""
    return max(0.0, float(row.get(PEAK, 0.0))) / tolerated_energy(float(row.get(WORK, 0.0)))


@cache
def _smaller_side(device: Device) -> float:
    """Of the workspace at every angle, or else at some (m)."""
    space = workspace(device)
    sides = space.extent(space.every) or space.extent(space.some) or ()
    return min((last - first for first, last in sides), default=math.inf)


def _lasted(row: Row) -> float:
    return math.inf if row["end"] == "duration" else float(row["end_time_s"])
