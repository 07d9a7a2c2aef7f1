"""`hapticlink study`."""

from __future__ import annotations

import os
from pathlib import Path

from hapticlink.orchestrator.commands.options import Out
from hapticlink.orchestrator.commands.sweep import Jobs


def study(*, out: Out = None, jobs: Jobs = None) -> int:
    """Study rates, holds and coupling; write tables, figures and a page to OUT (default
    results/mismatch). Runs are kept in sweeps/mismatch, so that an interrupted study can be
    continued."""
    from hapticlink.orchestrator.commands.progress import counted
    from hapticlink.orchestrator.study import cases
    from hapticlink.orchestrator.study import study as make

    made = cases.jobs()
    with counted("study") as tell:
        page = make(
            made, out or Path("results/mismatch"), Path("sweeps/mismatch"),
            jobs or os.cpu_count() or 1, lambda done: tell(done, len(made)),
        )  # fmt: skip
    print(page)
    return 0
