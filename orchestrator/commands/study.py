"""`hapticlink study`."""

from __future__ import annotations

import os
from pathlib import Path

from hapticlink.orchestrator.base.say import say
from hapticlink.orchestrator.commands.options import Out
from hapticlink.orchestrator.commands.sweep import Jobs


def study(*, out: Out = None, jobs: Jobs = None) -> int:
    """Study which hold, with which gains, at which graphics rate; write tables, figures and a page
    to OUT (default results/mismatch). Runs are kept in sweeps/mismatch, so that an interrupted
    study can be continued."""
    from hapticlink.orchestrator.commands.progress import counted, timed
    from hapticlink.orchestrator.study import expected
    from hapticlink.orchestrator.study import study as make

    processes = jobs or os.cpu_count() or 1
    guess = f"about {expected(processes):.0f} minutes with {processes} processes"
    with timed("hapticlink study", guess), counted("study") as tell:
        page = make(
            out or Path("results/mismatch"), Path("sweeps/mismatch"), processes,
            lambda stage, done, of: tell(done, of),
        )  # fmt: skip
    say(str(page))
    return 0
