"""The rows of a sweep on disk, each written when its run ends, and the table of all rows."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hapticlink.analysis.sweep.row import FAILED, METRIC, Row
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.terminal_output import align_columns
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.write_files import write_json

NOT_REPRODUCIBLE = "run_time_s"
HEADS = {
    "end": "end",
    "end_time_s": "at (s)",
    METRIC: "largest tracking error (mm)",
    "port_peak_J": "generated at the port (mJ)",
}
"""Columns of the terminal."""
MOST = 16
"""Runs in the terminal."""


class Rows:
    """A folder with one file per row, named by the key of its job."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def find(self, key: str) -> Row | None:
        """The row of an earlier sweep; None if there is none or it cannot be read."""
        try:
            row = text_files.read_json(self._folder / f"{key}.json", "a row")
        except InputFault:
            return None
        return row if isinstance(row, dict) else None

    def keep(self, key: str, row: Row) -> None:
        write_json(self._folder / f"{key}.json", row)


def columns(rows: Sequence[Row]) -> list[str]:
    """The columns of all rows, in the order of their first occurrence; the run time, which is not
    reproducible, comes last."""
    names = dict.fromkeys(name for row in rows for name in row)
    return sorted(names, key=lambda name: name == NOT_REPRODUCIBLE)


def lines(rows: Sequence[Row], keys: Sequence[str]) -> Iterator[str]:
    """The result as text: how many runs failed, and the main numbers of all, or of those with the
    smallest and the largest METRIC."""
    bad = sum(row["end"] in FAILED for row in rows)
    yield f"{len(rows)} runs over {', '.join(keys)}, {bad} failed"
    shown = {name: head for name, head in HEADS.items() if any(name in row for row in rows)}
    cells = [[_cell(name, row.get(name, "")) for name in (*keys, *shown)] for row in rows]
    order = [row.get(METRIC, math.inf) for row in rows]
    yield from few_lines([*keys, *shown.values()], cells, order)


def few_lines(heads: list[str], cells: list[list[str]], order: Sequence[float]) -> Iterator[str]:
    """The lines of a table; of more than MOST rows those of the smallest and largest `order`."""
    if len(cells) > MOST:
        indices = sorted(range(len(cells)), key=order.__getitem__)
        cells = [cells[i] for i in (*indices[: MOST // 2], *indices[-MOST // 2 :])]
        cells.insert(MOST // 2, ["..."] * len(heads))
    yield from (f"  {line}" for line in align_columns([heads, *cells]))


def _cell(name: str, value: Any) -> str:
    """Energies in mJ, as in all that is read."""
    if not isinstance(value, float):
        return str(value)
    return short(1e3 * value if name.endswith("_J") else value)


def write(path: Path, rows: Sequence[Row]) -> None:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns(rows), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    with atomic_file(path) as unfinished:
        unfinished.write_text(text.getvalue(), encoding="utf-8")
