"""`hapticlink reproduce`."""

from __future__ import annotations

import sys
from pathlib import Path

from hapticlink.orchestrator.commands.options import Out
from hapticlink.orchestrator.commands.progress import timed


def reproduce(*, out: Out = None) -> int:
    """Reproduce the report's figures from runs of the FMUs, with a page of the findings, in OUT
    (default results/report)."""
    from hapticlink.orchestrator.report import reproduce as make

    def tell(what: str) -> None:
        print(what, file=sys.stderr)

    with timed("hapticlink reproduce"):
        page = make(out or Path("results/report"), tell)
    print(page)
    return 0
