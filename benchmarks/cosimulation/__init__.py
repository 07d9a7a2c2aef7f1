"""Run time against error of the whole co-simulation: `hapticlink bench cosimulation`."""

from __future__ import annotations

from pathlib import Path

import hapticlink.orchestrator
from benchmarks import code_version
from benchmarks.continuous import kept
from benchmarks.cosimulation import page
from benchmarks.cosimulation.measure import measure
from benchmarks.cosimulation.points import CONTACT, LOOP, points
from benchmarks.page import Progress

ROUNDS = 5
KEPT = ("reference.csv", "runs.csv")


def bench(out: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes the figure and the rows to `out`; finished rows and references of the same
    version of the code are reused."""
    code_version.begin(out, KEPT, hapticlink.orchestrator)
    references = {}
    for k, name in enumerate((LOOP, CONTACT)):
        progress(f"{name}: two continuous runs", k, 2)
        references[name] = kept(out / "reference.csv", name)
    chosen = points(quick)
    rows = measure(out / "runs.csv", chosen, references, 2 if quick else ROUNDS, progress)
    return page.page(out, rows, references, command)
