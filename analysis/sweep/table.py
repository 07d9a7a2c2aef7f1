"""The rows of a sweep on disk, each written when its run ends, and the table of all rows."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from hapticlink.analysis.sweep.row import Row
from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.results import json_file
from hapticlink.orchestrator.results.files import write_json

NOT_REPRODUCIBLE = "run_time_s"


class Rows:
    """A folder with one file per row, named by the key of its job."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def find(self, key: str) -> Row | None:
        """The row of an earlier sweep; None if there is none or it cannot be read."""
        try:
            row = json_file.read(self._folder / f"{key}.json", "a row")
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


def write(path: Path, rows: Sequence[Row]) -> None:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns(rows), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    with atomic_file(path) as unfinished:
        unfinished.write_text(text.getvalue(), encoding="utf-8")
