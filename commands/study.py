from __future__ import annotations

from pathlib import Path

from hapticlink.commands import checkout
from hapticlink.commands.options import Out
from hapticlink.commands.sweep import Jobs
from hapticlink.orchestrator.base.process import count_processes
from hapticlink.orchestrator.base.terminal_output import say


def study(*, out: Out = None, jobs: Jobs = None) -> int:
    """Study which hold, with which gains, at which graphics rate; write tables, figures and a page
    to OUT (default results/mismatch). Runs are kept in sweeps/mismatch, so that an interrupted
    study can be continued."""
    from hapticlink.commands.progress import count_runs, time_command

    make = checkout.function("study", "studies.mismatch:study")
    expected = checkout.function("study", "studies.mismatch:expected")
    processes = count_processes(jobs)
    guess = f"about {expected(processes):.0f} minutes with {processes} processes"
    with time_command("hapticlink study", guess), count_runs("study") as tell:
        folder = out or Path("results/mismatch")
        page = make(folder, Path("sweeps/mismatch"), processes, tell)
    if out is None:
        sign = checkout.function("study", "benchmarks.code_version:sign")
        sign(checkout.folder("study") / "results", "study", page)
    say(str(page))
    return 0
