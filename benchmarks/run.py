"""The mechanism bench as a whole; finished rows are kept and used again."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from benchmarks import energy, growth, mechanism, report


def mechanism_bench(
    out: Path, quick: bool, told: Callable[[str, int, int], None], command: str
) -> None:
    """Write README.md, table.csv and two figures to `out`."""
    drifts = energy.measure(out, told)
    sizes = growth.measure(out, quick, told)
    report.write(out, *mechanism.measure(out, quick, told), drifts, sizes, command)
    shutil.rmtree(out / ".compiled", ignore_errors=True)
