"""The benchmark `mechanism`; finished rows of the same version of the code are reused."""

from __future__ import annotations

import shutil
from pathlib import Path

from benchmarks import code_version
from benchmarks.mechanism import energy, errors, growth, page
from benchmarks.page import Progress

ROWS = ("runs.csv", "energy.csv", "growth.csv", "references.json")


def bench(out: Path, quick: bool, progress: Progress, command: str) -> str:
    """Writes table.csv and two figures to `out`."""
    code_version.begin(out, ROWS)
    drifts = energy.measure(out, progress)
    sizes = growth.measure(out, quick, progress)
    found, missing = errors.measure(out, quick, progress)
    shutil.rmtree(out / ".compiled", ignore_errors=True)
    return page.page(out, found, missing, drifts, sizes, command)
