"""The benchmark `mechanism`; finished rows of the same version of the code are reused."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from benchmarks import code_version

ROWS = ("runs.csv", "energy.csv", "growth.csv", "references.json")


def bench(out: Path, quick: bool, progress: Callable[[str, int, int], None], command: str) -> None:
    """Write README.md, table.csv and two figures to `out`."""
    from benchmarks.mechanism import energy, errors, growth, page  # load Matplotlib

    code_version.begin(out, ROWS)
    drifts = energy.measure(out, progress)
    sizes = growth.measure(out, quick, progress)
    page.write(out, *errors.measure(out, quick, progress), drifts, sizes, command)
    shutil.rmtree(out / ".compiled", ignore_errors=True)
