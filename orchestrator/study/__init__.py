"""The study of mismatched rates: effect of rates, holds and coupling on error and energy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.study import errors, page
from hapticlink.orchestrator.sweep import Tell, sweep, table
from hapticlink.orchestrator.sweep.job import Job


def study(jobs: Sequence[Job], folder: Path, room: Path, processes: int, tell: Tell) -> Path:
    """Run the `jobs` that have no row in `room` yet, and write table, figures and README.md to
    `folder`; `tell` is called with the number of finished runs. Raises as `sweep` does."""
    folders.ensure(folder)
    rows = sweep(jobs, room, processes, tell=tell, measure=errors.measure)
    found = errors.compared(rows)
    table.write(folder / "table.csv", [errors.rounded(row) for row in found])
    return page.write(folder, found)
