from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from hapticlink.commands.options import Out
from hapticlink.orchestrator.base.terminal_output import say

Run = Annotated[Path, Parameter(help="Folder of a run.")]
To = Annotated[
    Literal["parquet", "mcap"],
    Parameter(help="parquet: a table for each rate; mcap: signals and mechanism for Foxglove."),
]


def export_results(run: Run, /, *, to: To, out: Out = None) -> int:
    """Write the results of a run for other tools, into its folder or OUT.

    For example:

        hapticlink export-results runs/closed-loop --to parquet
        hapticlink export-results runs/closed-loop --to mcap
    """
    import hapticlink as hl

    for path in hl.export_results(run, to=to, out=out):
        say(f"{path}: {path.stat().st_size / 1e3:.0f} kB")
    return 0
