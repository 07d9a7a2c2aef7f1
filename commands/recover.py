from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hapticlink.orchestrator.base.terminal_output import say

Folder = Annotated[Path, Parameter(help="Folder of a run that was killed.")]


def recover(folder: Folder, /) -> int:
    """Write the CSVs of a run that was killed, and report the time of its last row.

    For example:

        hapticlink recover runs/closed-loop
    """
    from hapticlink.orchestrator.results.recover import recover

    tables = recover(folder)
    for name, table in tables.items():
        say(f"{folder / name}.csv: {table.rows} rows to {table.time:.6g} s")
        if table.damaged:
            say(
                f"  the next of its rows has no time after that: {table.damaged} rows from it on "
                f"stay in {folder / name}.rows"
            )
    if not tables:
        say(f"{folder}: there is nothing to recover")
    return 0
