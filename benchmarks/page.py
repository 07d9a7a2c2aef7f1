"""What the pages of all benchmarks share."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterable, Iterator

Progress = Callable[[str, int, int], None]
"""Called with what is measured, and the numbers of what is done and of what there is to do."""


def table(heads: str, sides: str, rows: Iterable[Iterable[object]]) -> Iterator[str]:
    """The lines of a table. heads: with `|` between them; sides: l or r for each column."""
    yield f"| {heads} |"
    yield "|" + "".join("--:|" if side == "r" else "---|" for side in sides)
    for row in rows:
        yield f"| {' | '.join(map(str, row))} |"


def system() -> str:
    return f"{platform.system()} with {os.cpu_count()} cores"


def load_average() -> float:
    """Processes that waited for a processor in the last minute; 0 where that is not known."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
