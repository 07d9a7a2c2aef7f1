from __future__ import annotations

import sys
from pathlib import Path

from hapticlink.commands import checkout
from hapticlink.commands.options import Out
from hapticlink.commands.progress import time_command


def reproduce(*, out: Out = None) -> int:
    """Reproduce the report's figures from runs of the FMUs, with a page of the findings and a table
    of all its statements, in OUT (default results/report). Run it in the folder of the project's
    checkout, after the README's first command."""
    make = checkout.function("reproduce", "studies.report:reproduce")

    def tell(what: str) -> None:
        print(what, file=sys.stderr)

    with time_command("hapticlink reproduce"):
        page = make(out or Path("results/report"), tell)
    print(page)
    return 0
