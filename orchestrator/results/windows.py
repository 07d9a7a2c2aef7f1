"""The rows of a run as it has written them, one window of time after the other, so that the memory
of what reads them does not grow with the duration."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from hapticlink.orchestrator.base import temporary_folders, text_files
from hapticlink.orchestrator.results import binary_rows, run_record
from hapticlink.orchestrator.results.read_results import (
    TABLES,
    FolderTables,
    Results,
    Table,
    csv_parts,
    described,
    empty,
    load,
    recorded,
    run_json,
    size,
)
from hapticlink.orchestrator.results.run_record import RunRecord

WINDOW_BYTES = 1 << 24
"""Of the rows of a window, of all tables. Runs with fewer are one window."""
STEPS_BESIDE = 2
"""Rows beside a window, in the longest steps of all clocks, to interpolate between any two."""


def opened(folder: Path, record: RunRecord | None = None) -> Results:
    """The results of a run whose rows are still there, all of them read unless they are more than a
    window; `load` for others. record: the content of its run.json, where it is known."""
    run = text_files.read_json(folder / "run.json")
    if size(folder, run, binary=True) <= WINDOW_BYTES:
        return load(folder, binary=True, record=record)
    streamed = Streamed(folder, run, FolderTables(folder, run["rates"], run["files"]))
    return described(streamed, record) if record else streamed


@contextmanager
def of_run(folder: Path | str) -> Iterator[Results]:
    """The results of a run that has ended, in windows; where they are CSVs of more than a window,
    these are copied as rows into a temporary folder of the context. Raises InputFault as `load`."""
    folder = Path(folder)
    run = run_json(folder)
    tables = [folder / n for n in run_record.read(run, folder).files if n.endswith(TABLES)]
    csvs = [path for path in tables if path.suffix != binary_rows.SUFFIX]
    if not all(path.is_file() for path in tables) or size(folder, run) <= WINDOW_BYTES:
        yield load(folder, binary=True)
    elif not csvs:
        yield opened(folder)
    else:
        with temporary_folders.temporary_folder() as room:
            for path in csvs:
                copy_as_rows(path, room / f"{path.stem}{binary_rows.SUFFIX}")
            yield Streamed(room, run, FolderTables(room, run["rates"], run["files"]))


def copy_as_rows(path: Path, target: Path) -> None:
    """Write a CSV of a run as rows, a window at a time. Raises InputFault as `read_table`."""
    with target.open("xb") as file:
        for columns, part in csv_parts(path, WINDOW_BYTES):
            if not file.tell():
                file.write(binary_rows.header(columns))
            file.write(part.tobytes())


@dataclass(frozen=True, eq=False)
class Streamed(Results):
    """Results whose windows are read from the rows, while these are there; the tables themselves
    are read whole, as `FolderTables`."""

    @cached_property
    def number(self) -> int:
        """The number of windows."""
        assert self.folder
        return -(-size(self.folder, self.run, binary=True) // WINDOW_BYTES)

    def windows(self) -> Iterator[Results]:
        assert self.folder
        record, end, beside = self.record, self.record.end.time or 0.0, _beside(self.record)
        files = {
            name: binary_rows.Written(self.folder / f"{name}{binary_rows.SUFFIX}")
            for name in record.rates
            if recorded(name, record.files)
        }
        cuts = [-np.inf, *(end * np.arange(1, self.number) / self.number), np.inf]
        for begin, until in pairwise(map(float, cuts)):
            span = begin - beside, until + beside
            # No table of a window knows the others: a cycle would stay until the next collection.
            tables = {
                name: _part(files[name], *span) if name in files else empty({})
                for name in record.rates
            }
            yield described(Results(self.folder, self.run, tables, begin, until), record)


def until(results: Results, time: float) -> Iterator[Results]:
    """The windows of results until a time (s)."""
    for window in results.windows():
        if window.begin < time:
            yield described(replace(window, end=min(window.end, time)), results.record)


def last(results: Results) -> Results:
    """The last window of results, without those before it in memory."""
    return deque(results.windows(), maxlen=1).pop()


def _beside(record: RunRecord) -> float:
    """The time (s) of the rows beside a window."""
    longest = max(clock.longest for clock in record.clocks.values())
    first = max(clock.first for clock in record.clocks.values())
    return STEPS_BESIDE * max(longest, first) * int(record.scene["record"]["every"])


def _part(table: binary_rows.Written, begin: float, end: float) -> Table:
    """The rows of begin <= time <= end (s)."""
    span = table.between(begin, end)
    return Table(table.columns, table[span], {}, span.start, len(table))
