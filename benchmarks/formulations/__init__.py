"""The three ways of section B.2 to simulate a closed loop, beside each other."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from benchmarks import code_version
from benchmarks.rows import Rows


def bench(out: Path, quick: bool, progress: Callable[[str, int, int], None], command: str) -> None:
    """Write README.md, cases.csv and formulations.png to `out`."""
    from benchmarks.formulations import page  # loads Matplotlib

    code_version.begin(out, ("cases.csv",))
    rows = Rows(out / "cases.csv", page.COLUMNS, keys=2)
    page.measure(rows, 6 if quick else 60, out / ".compiled", progress)
    page.write(out, rows, command)
    shutil.rmtree(out / ".compiled", ignore_errors=True)
