"""The numbers of one run, as a row of the sweep's table.

Column names end in the unit. The cell of a signal that a scene does not have is empty.
"""

from __future__ import annotations

from typing import Any

from hapticlink.analysis.findings.measures import Measures
from hapticlink.orchestrator.experiment import Experiment
from hapticlink.orchestrator.results.read_results import Results

Row = dict[str, Any]

METRIC = "tracking_max_mm"
DONE, REFUSED, DIED, INTERRUPTED = "done", "refused", "died", "interrupted"
WHOLE = ("duration",)
"""Ends of runs whose numbers can be compared: they lasted as long as the scene says."""
FAILED = ("fault", "diverged", REFUSED, DIED)
"""Ends with an error: a fault of the run, divergence, bad input, and what is no fault of the scene
(a process that crashed or hung, a full disk)."""


def measure(experiment: Experiment) -> Row:
    """All numbers of a run that the table lists."""
    return of_results(experiment.results)


def of_results(results: Results) -> Row:
    record, measures = results.record, Measures(results, works=False)
    row: Row = {
        "end": record.end.reason,
        "end_time_s": record.end.time,
        "message": _line(record.fault.message) if record.fault else "",
    }
    if error := measures.tracking.get(""):
        row |= {METRIC: error.max_mm, "tracking_rms_mm": error.rms_mm}
        row |= {"theta_max_rad": error.max_rad, "theta_rms_rad": error.rms_rad}
    if measures.closure_m is not None:
        row["closure_max_m"] = measures.closure_m
    if counts := measures.constrained:
        row |= {"switches": counts.switches, "more_constrained_percent": counts.more_percent}
    folded_frames, frames = measures.folded
    if frames:
        row["folded_frames"] = folded_frames
    if port := measures.port:
        row |= {"port_generated_J": port.generated, "port_peak_J": port.peak}
        row |= {f"port_J {name}": block.generated for name, block in port.blocks.items()}
    if held := measures.held:
        row["held_energy_generated_J"] = sum(energy.generated for energy in held.values())
        row["held_energy_peak_J"] = sum(energy.peak for energy in held.values())
        row |= {f"generated_J {name}": energy.generated for name, energy in held.items()}
        row |= {f"peak_J {name}": energy.peak for name, energy in held.items()}
    row |= {f"steps {name}": counts.get("step", 0) for name, counts in record.calls.items()}
    return row | {"run_time_s": record.timings.run}


def failed(reason: str, message: str) -> Row:
    """The row of a run without results."""
    return {"end": reason, "message": _line(message)}


def _line(message: str) -> str:
    return " ".join(message.split())
