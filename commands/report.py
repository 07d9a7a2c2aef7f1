from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.terminal_output import say

Runs = Annotated[list[Path], Parameter(help="Folders of runs.", negative="")]
Out = Annotated[Path | None, Parameter(help="File to write; by default reports/RUNS.html.")]


def report(runs: Runs, /, *, out: Out = None) -> int:
    """Write a page of a run, or of several beside each other: what ran, outcome,
    performance, energies, timing, settings that differ, and the commands that repeat it.

    For example:

        hapticlink report runs/closed-loop
        hapticlink report runs/on runs/off --out report.html
    """
    from hapticlink.fmus.atomic_file import atomic_file
    from hapticlink.orchestrator.results import folders
    from hapticlink.visualization.compare import page

    results = folders.load_by_name(runs)
    path = out or Path("reports") / f"{'+'.join(name.replace('/', '-') for name in results)}.html"
    if path.is_dir():
        raise InputFault(f"--out {path}: is a folder; name a file, such as {path / 'report.html'}")
    folders.ensure(path.parent)
    text = page.page(results)
    with atomic_file(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")
    say(f"{path}: {path.stat().st_size / 1e3:.0f} kB")
    return 0
