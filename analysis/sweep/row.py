"""The numbers of one run, as a row of the sweep's table.

Column names end in the unit. The cell of a signal that a scene does not have is empty.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hapticlink.analysis.findings.tracking import (
    constrained,
    folded,
    has_tracking,
    of_block,
    pose_error,
)
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.orchestrator.base.loop_names import CLOSURE_ERROR
from hapticlink.orchestrator.experiment import Experiment
from hapticlink.orchestrator.results.tables import Results, Vector

Row = dict[str, Any]

METRIC = "tracking_max_mm"
REFUSED, DIED, INTERRUPTED = "refused", "died", "interrupted"
FAILED = ("fault", "diverged", REFUSED, DIED)
"""Ends with an error: a fault of the run, divergence, bad input, and what is no fault of the scene
(a process that crashed or hung, a full disk)."""


def measure(experiment: Experiment) -> Row:
    """All numbers of a run that the table lists."""
    outcome = experiment.outcome
    results = experiment.results
    held = {c.name for c in experiment.system.connections if c.hold}
    generated = {n: e.generated for n, e in outcome.energies.items() if n in held}
    found: Row = {
        "end": outcome.reason,
        "end_time_s": outcome.end_time,
        "message": _line(str(outcome.fault)) if outcome.fault else "",
        **_tracking(results),
        **_largest(results, "closure_max_m", CLOSURE_ERROR),
        **_switches(results),
        **_folded(results),
        **_port(results),
    }
    if generated:
        peaks = {n: outcome.energies[n].peak for n in generated}
        found["held_energy_generated_J"] = sum(generated.values())
        found["held_energy_peak_J"] = sum(peaks.values())
        found |= {f"generated_J {name}": energy for name, energy in generated.items()}
        found |= {f"peak_J {name}": energy for name, energy in peaks.items()}
    calls = outcome.calls
    found |= {f"steps {name}": counts.get("step", 0) for name, counts in calls.items()}
    return found | {"run_time_s": outcome.wall_time}


def failed(reason: str, message: str) -> Row:
    return {"end": reason, "message": _line(message)}


def _line(message: str) -> str:
    return " ".join(message.split())


def _tracking(results: Results) -> Row:
    if not has_tracking(results):
        return {}
    _, distance, angle = pose_error(results)
    if not len(distance):
        return {}
    return {
        METRIC: float(distance.max()),
        "tracking_rms_mm": _rms(distance),
        "theta_max_rad": float(angle.max()),
        "theta_rms_rad": _rms(angle),
    }


def _rms(values: Vector) -> float:
    largest = values.max()
    return float(largest * np.sqrt(np.mean((values / largest) ** 2))) if largest else 0.0


def _largest(results: Results, column: str, signal: str) -> Row:
    table = of_block(results, signal)
    if table is None or not len(table["time"]):
        return {}
    return {column: float(np.abs(table[signal]).max())}


def _folded(results: Results) -> Row:
    count, frames = folded(results)
    return {"folded_frames": count} if frames else {}


def _port(results: Results) -> Row:
    if (port := user_port(results)) is None:
        return {}
    told = port.told
    found = {"port_generated_J": told["generated"], "port_peak_J": told["peak"]}
    return found | {f"port_J {name}": block["generated"] for name, block in told["blocks"].items()}


def _switches(results: Results) -> Row:
    """How often the number of constrained directions changes, and how long it is above its
    least."""
    if (found := constrained(results)) is None:
        return {}
    table, signal = found
    count = table[signal]
    more = 100 * float((count > count.min()).mean()) if len(count) else 0.0
    switches = int(np.count_nonzero(np.diff(count)))
    return {"switches": switches, "more_constrained_percent": more}
