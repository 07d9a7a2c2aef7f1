"""What gains do along the scene's own run.

A projector on the constrained directions that is held is stale while the mechanism moves, which a
linearisation at rest cannot show: gains that stiffen a constraint can throw the handle off. So the
handle may leave the operational point by at most TRACKED times as far as with the scene's own
gains, scaled to the margin where they lack it, and the user's port may give as much energy as with
these, or a quarter of the hand's work, which is the limit of `advise`.
"""

from __future__ import annotations

import numpy as np

from hapticlink.analysis.findings.measures import Measures
from hapticlink.analysis.findings.user_port import tolerated
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results.read_results import Results

TRACKED = 1.2


def motion(run: Results, end: float = 0.0) -> dict[str, float]:
    """The largest distance (m) of handle and operational point, infinite where the run fails or
    ends before `end` (s), and the largest energy (J) that was generated at the user's port."""
    measures = Measures(run)
    error, port = measures.tracking[""], measures.port
    fails = run.record.fault or error.end_s < end
    return {
        "distance": np.inf if fails else error.max_mm / 1e3,
        "energy_peak": port.peak if port else np.nan,
    }


class RunLimit:
    """What runs with other gains have to keep, from a `run` with gains that hold. Raises InputFault
    where that fails."""

    def __init__(self, run: Results) -> None:
        self._end = Measures(run).tracking[""].end_s
        own = motion(run)
        self._distance = TRACKED * own["distance"]
        self._energy = max(own["energy_peak"], tolerated(run))
        if not np.isfinite(self._distance):
            raise InputFault(
                f"the scene's own run fails: {run.record.fault}; take smaller gains, or a duration "
                "that ends before"
            )

    def motion(self, run: Results) -> dict[str, float]:
        """The `motion` of a run. Raises InputFault where it fails, ends early, or the handle leaves
        the operational point further than it may."""
        moved = motion(run, self._end)
        if not moved["distance"] <= self._distance:
            raise InputFault(
                f"the run: the handle may leave its point by {1e3 * self._distance:.3g} mm"
            )
        if moved["energy_peak"] > self._energy:
            raise InputFault(
                f"the run: the user's port may give {1e3 * self._energy:.3g} mJ and gives "
                f"{1e3 * moved['energy_peak']:.3g}"
            )
        return moved
