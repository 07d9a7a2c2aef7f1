"""The mismatch itself: what rates, holds and coupling do to error and energy, as one page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.study import errors, page
from hapticlink.orchestrator.sweep import Tell, sweep, table
from hapticlink.orchestrator.sweep.job import Job


def study(jobs: Sequence[Job], folder: Path, room: Path, processes: int, tell: Tell) -> Path:
    """Make the runs that `room` does not hold yet, and write table, figures and README.md into
    `folder`; `tell` hears how many are done."""
    folders.made(folder)
    rows = sweep(jobs, room, processes, tell=tell, measure=errors.measure)
    found = errors.compared(rows)
    table.write(folder / "table.csv", [errors.rounded(row) for row in found])
    return page.write(folder, found)
