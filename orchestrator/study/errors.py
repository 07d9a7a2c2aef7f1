"""Tracking, coupling and modelling errors of the study's runs.

Tracking: |x_S - x_D| (mm). Coupling: distance of the handle from that of the same blocks run
continuously, with their own Lambda^-1 and nothing held. Modelling: distance of the handle without
Coriolis and centrifugal compensation from that with it. Both are taken on one grid, up to the first
end of the two runs, and over the first second as well, before the active loop has amplified the
difference.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from hapticlink.orchestrator.experiment import Experiment
from hapticlink.orchestrator.results.tables import Vector
from hapticlink.orchestrator.study.cases import FLOOR, REFERENCE
from hapticlink.orchestrator.sweep import row as sweep_row
from hapticlink.orchestrator.sweep.row import Row

GRID = 128
"""Rate (Hz) of the grid on which paths of the handle are compared; it divides all haptic rates."""
PATH = "handle"
PARTS = ("scene", "gains", "model", "sync", "bias", "hold", "rate", "seed")


def measure(experiment: Experiment) -> Row:
    """The sweep's row, and the handle's path."""
    found = sweep_row.measure(experiment)
    rate = experiment.scene.haptics.rate
    handle = experiment.results.haptics["haptic_device.x_true"]
    return found | {PATH: handle[:: int(rate) // GRID, :2].tolist()}


def compared(rows: Sequence[Row]) -> list[Row]:
    """The rows with their coupling and modelling errors, without the paths."""
    by_case = {_case(r): r for r in rows}
    found = []
    for r in rows:
        gains, bias = r["gains"], r["bias"]
        row = {k: v for k, v in r.items() if k != PATH}
        if PATH in r:
            if r["rate"] != str(REFERENCE):
                reference = by_case[_case(continuous(gains, bias))]
                row |= _distance("coupling", r, reference)
            if bias == "none" and PATH in (other := by_case[_case({**r, "bias": "full"})]):
                row |= _distance("modelling", r, other)
        found.append(row)
    return found


def continuous(gains: str, bias: str, rate: int = REFERENCE) -> Row:
    """The key columns of a continuous run."""
    return {"scene": "continuous", "gains": gains, "bias": bias, "rate": str(rate)}


def floor(rows: Iterable[Row], column: str) -> float:
    """The largest coupling error of the runs at half the reference's rate: smaller errors cannot be
    distinguished from zero."""
    return max(r[column] for r in rows if r["scene"] == "continuous" and r["rate"] == str(FLOOR))


def rounded(row: Row) -> Row:
    """A row with four digits and without machine-dependent columns, for a table under version
    control."""
    return {
        k: float(f"{v:.4g}") if isinstance(v, float) else v
        for k, v in row.items()
        if not k.startswith(("steps ", "generated_J ", "run_time"))
    }


def _case(row: Row) -> tuple[str, ...]:
    return tuple(row.get(part, "") for part in PARTS)


def _distance(name: str, row: Row, other: Row) -> Row:
    a, b = (np.array(r[PATH]) for r in (row, other))
    apart: Vector = 1e3 * np.linalg.norm(a[: len(b)] - b[: len(a)], axis=1)
    return {
        f"{name}_1s_mm": float(apart[: GRID + 1].max()),
        f"{name}_max_mm": float(apart.max()),
    }
