"""The results of a run while it runs: the rows of each clock, in memory."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.fmi.transfer import known_texts
from hapticlink.orchestrator.results.read_results import Table
from hapticlink.orchestrator.results.rows_file import name_texts, text_numbers


@dataclass(frozen=True)
class TableRows:
    """The rows of a table: `time` and those `values` whose places the columns `recorded` name, at
    every `every`-th call of `Recorder.row`, and at the one numbered `end`, the last one, from 0 on;
    where `recorded` is None there is no table, and rows are counted only. most: calls that there
    may be, where a rate may be raised during the run. before: calls in the run that this one goes
    on from. texts: the FMI types of those columns that are texts, by their places in a row."""

    recorded: Mapping[str, int] | None
    values: Vector
    every: int = 1
    end: int = 0
    most: int = 0
    before: int = 0
    texts: Mapping[int, str] = field(default_factory=dict)


class Recorder:
    """Records rows. `first` is called after the first one. A context manager.

    rows: of the whole run, of which `filled` are written. `view` is `values` at `places` where
    these are side by side, else None. `due`: whether the next row is written. `room`: the rows that
    may be filled, 0 until the first row is. `count`: rows so far, written or not. `reached`: time
    of the newest (s). They are shared with the compiled loop.
    """

    files: tuple[str, ...] = ()
    """The names of those to which rows are written."""

    def __init__(self, of: TableRows, first: Callable[[], object]) -> None:
        places, values = [*(of.recorded or {}).values()], of.values
        self.values, self.places, self.texts = values, np.array(places, np.int64), of.texts
        self.every, self.end, before = of.every, of.end, of.before
        self.columns = ("time", *(of.recorded or ()))
        span = slice(places[0], places[-1] + 1) if places else slice(0)
        self.view = values[span] if places == [*range(len(values))[span]] else None
        self._first, self.before = first, before
        due = before % of.every == 0 or before == of.end
        self.due, self.room, self.count = (ctypes.c_int64(n) for n in (due, 0, before))
        self.reached = ctypes.c_double()
        coming = max(of.end - before, of.most) // of.every + 2
        self.rows, self.filled = self._new_rows(of.recorded is not None, coming)

    def _new_rows(self, recorded: bool, most: int) -> tuple[Vector | None, ctypes.c_int64]:
        """Room for the rows of the whole run, and the number of those that are written."""
        return np.empty((most, len(self.columns))) if recorded else None, ctypes.c_int64()

    @property
    def last(self) -> float | None:
        """The time (s) of the newest row, None before the first."""
        return self.reached.value if self.count.value > self.before else None

    @property
    def recorded(self) -> int:
        """The rows that were to be written so far, of those that were counted."""
        return 0 if self.rows is None else self._due(self.count.value) - self._due(self.before)

    def _due(self, count: int) -> int:
        """The rows that are to be written of so many calls."""
        ended = count > self.end > 0 and self.end % self.every != 0
        return -(-count // self.every) + ended

    @property
    def is_awaited(self) -> bool:
        """Whether its first row is to come: of a run that goes on there may be none."""
        return self.last is None and not self.before

    def row(self, time: float) -> None:
        """Write a row at `time` (s). Raises OSError, as on a full disk."""
        if self.due.value and self.rows is not None:
            self._make_room()
            row = self.rows[self.filled.value]
            row[0], row[1:] = time, self.values[self.places] if self.view is None else self.view
            self.filled.value += 1
        self.reached.value = time
        self.count.value += 1
        self.due.value = self.count.value % self.every == 0 or self.count.value == self.end
        if self.count.value == self.before + 1:
            self._first()
            del self._first  # which holds the results: rows would stay until cycles are searched
            self.room.value = self._make_room()

    def _make_room(self) -> int:
        """The number of rows that may be filled, more than are."""
        return 1 if self.rows is None else len(self.rows)

    def discard(self) -> None:
        """Remove the rows, where they are not published."""

    def publish(self) -> None:
        """Replace the table of an earlier run by this one."""

    def finish(self) -> None:
        """Make the CSV of the rows, which stay, and `require_whole`. Raises OSError, as on a full
        disk."""

    def require_whole(self) -> None:
        """Raises Fault where the file does not have the rows that were recorded."""

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to close."""


class RunResults:
    """Results that are in no file. `published`: every table has a row. `folder` is where they are,
    for messages. log_path: the file of what FMUs log, "" for none."""

    log_path = ""

    def __init__(self, folder: Path = Path("memory")) -> None:
        self.folder, self.published = folder, False
        self._recorders: dict[str, Recorder] = {}

    def recorder(self, clock: str, of: TableRows) -> Recorder:
        """The recorder of a clock. All recorders have to be created before the first row."""
        self._recorders[clock] = made = self._new_recorder(clock, of)
        return made

    def _new_recorder(self, clock: str, of: TableRows) -> Recorder:
        return Recorder(of, self._publish)

    def finish(self) -> None:
        """Make the CSVs of all clocks. Raises OSError, as on a full disk; the rows can be read
        nevertheless."""
        for recorder in self._recorders.values():
            recorder.finish()

    @property
    def last(self) -> float:
        """The time (s) of the last row of the first clock."""
        return next((r.last or 0.0 for r in self._recorders.values()), 0.0)

    def _publish(self) -> None:
        """Called by each recorder after its first row."""
        if self._may_be_published():
            for recorder in self._recorders.values():
                recorder.publish()
            self.published = True

    def _may_be_published(self) -> bool:
        awaited = any(recorder.is_awaited for recorder in self._recorders.values())
        return not (self.published or awaited)

    def tables(self) -> dict[str, Table]:
        """The tables by clock, which keep what is read of them."""
        return {clock: _table_of(r) for clock, r in self._recorders.items()}


def _table_of(r: Recorder) -> Table:
    rows = np.zeros((0, 1)) if r.rows is None else r.rows[: r.filled.value]
    texts = name_texts(r.texts, known_texts(text_numbers([rows], r.texts)))
    return Table(r.columns, rows, texts=texts, _kept={})
