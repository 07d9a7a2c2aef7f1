"""Reads results back: one CSV per rate, and `run.json`."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import chain
from pathlib import Path
from textwrap import fill
from typing import Any, ClassVar, TypeVar

import numpy as np

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.variables import entry_of
from hapticlink.orchestrator.results import rows_file, run_record
from hapticlink.orchestrator.results.rows_file import RowsFile
from hapticlink.orchestrator.results.run_record import RunRecord

TABLES = (".csv", rows_file.SUFFIX)
"""Endings of the names of tables."""
IN_MEMORY = 1 << 24
"""Bytes of the rows of a table, above which they stay in their file."""
BLOCK = 1 << 12
"""Rows of a long run that are in memory at a time."""


Entries = tuple[tuple[int, ...], tuple[int, ...]]
"""The columns of the entries of a vector or matrix, and its shape."""


@dataclass(frozen=True, repr=False, eq=False)
class Table(Mapping[str, Vector]):
    """The samples of one rate by name: `table["device.x"]` stacks the columns `device.x[1]`,
    `device.x[2]`, ... into (rows, n), those of a matrix into (rows, n, m), by their indices,
    whichever column comes first; entries with gaps between them into (rows, k). The full name of a
    column gives that column, (rows,). A String or Binary is an array of str, of which `rows` have
    the numbers of `texts`. Raises KeyError for an unknown name. `others` are the tables
    of the same run, for that message. `rows` of a long run are in their file.
    """

    columns: tuple[str, ...]
    rows: Vector | RowsFile
    others: Mapping[str, Table] = field(default_factory=dict)
    texts: rows_file.Texts = field(default_factory=dict)
    # The columns that have been read, of a table that keeps them, as arrays that nobody writes.
    _kept: dict[Any, Vector] | None = None

    def __getitem__(self, name: str) -> Vector:
        if (place := self._places.get(name)) is not None:
            return self._read(place) if place else self._time
        if name not in self._arrays:
            there = [other for other, table in self.others.items() if name in table]
            hint = f"; it is in tables[{there[0]!r}]" if there else ""
            raise KeyError(f"no signal {name!r}{hint}; there are {', '.join(self.columns)}")
        places, shape = self._arrays[name]
        return self._read(places).reshape(-1, *shape)

    @cached_property
    def _time(self) -> Vector:
        return self._read(0)

    @cached_property
    def least_step(self) -> float:
        """The least time (s) from one row to the next."""
        return float(np.diff(self["time"]).min(initial=math.inf))

    def _read(self, places: int | Sequence[int]) -> Vector:
        """Columns; of a file copies, which take less memory than the rows that are mapped."""
        found = self._read_numbers(places)
        if not (self.texts and self.texts.keys() & {*np.ravel(places)}):
            return found
        each = zip(np.ravel(places), found.T.reshape(-1, len(self.rows)), strict=True)
        words = [np.array([self.texts[int(at)][int(n)] for n in row], np.str_) for at, row in each]
        read: Any = np.stack(words, axis=-1).reshape(found.shape)
        return read  # a vector of numbers, but for texts

    def _read_numbers(self, places: int | Sequence[int]) -> Vector:
        if not isinstance(self.rows, RowsFile):
            if self._kept is None:
                return self.rows[:, places]
            if places not in self._kept:
                self._kept[places] = found = self.rows[:, places]
                found.flags.writeable = False
            return self._kept[places]
        found = np.empty((*np.shape(places), len(self.rows))).T
        for first in range(0, len(found), BLOCK):
            span = slice(first, first + BLOCK)
            found[span] = self.rows[span][:, places]
        return found

    def blocks(self, more: int = 0) -> Iterator[Table]:
        """The table, or that of a long run in blocks of rows, each with `more` rows of the next."""
        if not isinstance(self.rows, RowsFile):
            yield self
            return
        for first in range(0, len(self.rows) - more, BLOCK):
            yield self.part(slice(first, first + BLOCK + more))

    def part(self, span: slice) -> Table:
        """The table of some rows."""
        part = Table(self.columns, self.rows[span], texts=self.texts)
        vars(part).update(_places=self._places, _arrays=self._arrays)
        return part

    @property
    def start(self) -> Table:
        """The table of the first row."""
        return self.part(slice(1))

    def by_row(self, of_rows: Callable[..., Vector], *names: str) -> Vector:
        """What a function gives for the rows of signals, (k, ...) -> (k,) or (n, k). Of a long run
        only the result is in memory."""
        parts = [of_rows(*(block[name] for name in names)) for block in self.blocks()]
        return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=-1)

    def shape(self, name: str) -> tuple[int, ...]:
        """The shape of a sample of a signal, which is here."""
        return () if name in self._places else self._arrays[name][1]

    @cached_property
    def _places(self) -> dict[str, int]:
        return _find_columns(self.columns)[0]

    @cached_property
    def _arrays(self) -> dict[str, Entries]:
        return _find_columns(self.columns)[1]

    def __contains__(self, name: object) -> bool:
        return name in self._places or name in self._arrays

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def __repr__(self) -> str:
        return fill(f"{len(self.rows)} rows of {', '.join(self.signals)}", 100)

    @property
    def signals(self) -> tuple[str, ...]:
        """The names of scalars, vectors and matrices, `time` the first."""
        return tuple(dict.fromkeys(entry_of(column)[0] for column in self.columns))


@lru_cache(16)
def _find_columns(columns: tuple[str, ...]) -> tuple[dict[str, int], dict[str, Entries]]:
    """The place of each column; and those of the entries of each vector and matrix, with its shape:
    the same in every point of a sweep."""
    entries: dict[str, list[tuple[tuple[int, ...], int]]] = {}
    for place, column in enumerate(columns):
        name, indices = entry_of(column)
        if indices:
            entries.setdefault(name, []).append((indices, place))
    ordered = {name: zip(*sorted(each), strict=True) for name, each in entries.items()}
    arrays = {name: (places, _shape(indices)) for name, (indices, places) in ordered.items()}
    return {column: place for place, column in reversed([*enumerate(columns)])}, arrays


def _shape(indices: Sequence[tuple[int, ...]]) -> tuple[int, ...]:
    """The shape of the array that has entries at `indices`, which may begin at 0 or 1; one
    dimension where they fill none."""
    if len({len(index) for index in indices}) == 1:
        shape = tuple(max(axis) - min(axis) + 1 for axis in zip(*indices, strict=True))
        if math.prod(shape) == len({*indices}) == len(indices):
            return shape
    return (len(indices),)


@dataclass(frozen=True, eq=False)
class Results:
    """The results of a run: `run` is run.json, `tables` the CSVs by rate; `folder` is None if it
    was run in memory."""

    folder: Path | None
    run: dict[str, Any]
    tables: Mapping[str, Table]
    known_scene: ClassVar[Any] = None
    """The Scene, of which run.json has the tables, where this process has just run it."""

    @property
    def last_time(self) -> float:
        """The time (s) of the last row of the first table that has any."""
        return next((float(t["time"][-1]) for t in self.tables.values() if len(t.rows)), 0.0)

    def has_rows_of(self, other: Results) -> bool:
        """Whether both recorded the same signals with the same numbers."""
        pairs = ((self.tables[n], other.tables[n]) for n in self.tables if n in other.tables)
        return [*self.tables] == [*other.tables] and all(
            mine.columns == its.columns and _are_equal(mine, its) for mine, its in pairs
        )

    @cached_property
    def record(self) -> RunRecord:
        """The content of run.json as a record. Raises InputFault where it is of another version, or
        was changed."""
        return run_record.read_record(self.run, self.folder)

    @property
    def haptics(self) -> Table:
        """The Table of the haptic rate."""
        return self.tables["haptics"]

    @property
    def graphics(self) -> Table:
        """The Table of the graphics rate; KeyError where no FMU runs at it."""
        return self.tables["graphics"]


def _are_equal(mine: Table, its: Table) -> bool:
    """Whether tables of the same columns have the same rows."""
    if not (mine.texts or its.texts):
        return np.array_equal(mine.rows, its.rows, equal_nan=True)
    pairs = ((mine[column], its[column]) for column in mine.columns)
    return all(np.array_equal(a, b, equal_nan=a.dtype == float) for a, b in pairs)


R = TypeVar("R", bound=Results)


def with_record(results: R, record: RunRecord, scene: object = None) -> R:
    """Results whose `record`, and perhaps `known_scene`, are known without reading `run`."""
    vars(results).update(record=record, known_scene=scene)
    return results


class FolderTables(Mapping[str, Table]):
    """The tables of a run's folder by rate, each read when it is asked for and kept then."""

    def __init__(self, folder: Path, record: RunRecord, from_rows: bool = False) -> None:
        """from_rows: from the rows where they are still there, long ones without reading them."""
        self._folder, self._record, self._from_rows = folder, record, from_rows
        self._read: dict[str, Table] = {}

    def __getitem__(self, rate: str) -> Table:
        if rate not in self._record.rates:
            raise KeyError(rate)
        if rate not in self._read:
            there = any(rate + suffix in self._record.files for suffix in TABLES)
            path = self._folder / f"{rate}.csv"
            read = read_table(path, self, self._from_rows) if there else None
            self._read[rate] = read or Table(("time",), np.zeros((0, 1)), self)
        return self._read[rate]

    def __iter__(self) -> Iterator[str]:
        return iter(self._record.rates)

    def __len__(self) -> int:
        return len(self._record.rates)


def load(folder: Path | str, from_rows: bool = False, record: RunRecord | None = None) -> Results:
    """Reads a run's folder; `from_rows`: from the rows where they are still there. record: the
    content of its run.json, where it is known. Raises InputFault if it contains no run, one of
    another version, or one that was changed."""
    folder = Path(folder)
    run = run_json(folder)
    record = record or run_record.read_record(run, folder)
    return with_record(Results(folder, run, {**FolderTables(folder, record, from_rows)}), record)


def read_into_memory(results: Results) -> Results:
    """Results whose files are no longer needed."""
    tables = {
        name: replace(table, rows=table.rows.read()) if isinstance(table.rows, RowsFile) else table
        for name, table in results.tables.items()
    }
    return with_record(replace(results, tables=tables), results.record, results.known_scene)


def without_rows(results: Results) -> Mapping[str, Table]:
    """The tables of results whose rows are removed: those in memory, of a long run its CSVs."""
    if any(isinstance(table.rows, RowsFile) for table in results.tables.values()):
        assert results.folder
        return FolderTables(results.folder, results.record)
    return results.tables


def run_json(folder: Path) -> dict[str, Any]:
    """The content of the run.json of a run's folder. Raises InputFault where there is none."""
    try:
        content: dict[str, Any] = text_files.read_json(folder / "run.json")
    except InputFault as error:
        raise InputFault(f"{folder}: not the folder of a run: {error}") from error
    return content


def read_table(
    path: Path, others: Mapping[str, Table] | None = None, from_rows: bool = False
) -> Table:
    """Reads one CSV of a run, or its rows where the run was killed, or where these are wanted and
    there; `others` are the run's other tables. Raises InputFault for a table that is not as a run
    writes it."""
    others = {} if others is None else others
    rows = path.with_suffix(rows_file.SUFFIX)
    if not rows.exists() or (path.exists() and not from_rows):
        columns, values, texts = _read_csv(path)
        return Table(columns, values, others, texts)
    _require_file(rows)
    written = RowsFile(rows)
    read = written if written.size > IN_MEMORY else written.read()
    return Table(written.columns, read, others, written.texts)


def _read_csv(path: Path) -> tuple[tuple[str, ...], Vector, rows_file.Texts]:
    """The columns of a CSV of a run, and its rows, with the texts of their numbers."""
    _require_file(path)
    try:
        with path.open(encoding="utf-8", newline="") as file:
            columns = tuple(next(csv.reader([file.readline()])))
            if columns[:1] != ("time",):
                why = f"its first column is {columns[0] if columns else ''!r}, not 'time'"
                raise InputFault(f"{path}: line 1: {why}: run the scene again")
            if not (first := file.readline()):
                return columns, np.zeros((0, len(columns))), rows_file.NO_TEXTS
            # The text of all lines would take twice what they take.
            lines, texts = chain([first], file), rows_file.NO_TEXTS
            if '"' in first:
                values, texts = _read_texts(lines)
            else:
                values = np.loadtxt(lines, delimiter=",", ndmin=2)
        if values.shape[1] != len(columns):
            raise ValueError
    except OSError as error:
        raise InputFault(f"{path}: {error.strerror}: run the scene again") from error
    except csv.Error as error:  # a line without end
        raise InputFault(f"{path}: {error}: run the scene again") from error
    except (IndexError, ValueError) as error:
        line = _find_malformed_line(path)
        raise InputFault(f"{path}: {line or error}: run the scene again") from error
    ordered = np.diff(values[:, 0], prepend=-math.inf) >= 0
    if not ordered.all():
        late = int(ordered.argmin())
        why = f"time = {values[late, 0]:g} s is before that of the line above"
        raise InputFault(f"{path}: line {late + 2}: {why}: run the scene again")
    return columns, values, texts


def _read_texts(lines: Iterator[str]) -> tuple[Vector, rows_file.Texts]:
    """The numbers of rows in which texts are in quotes, each text counted as it comes."""
    known: dict[str, int] = {}
    rows: list[list[Any]] = [*csv.reader(lines, quoting=csv.QUOTE_NONNUMERIC, strict=True)]
    places = [place for place, cell in enumerate(rows[0]) if isinstance(cell, str)]
    for row in rows:
        for place in places:
            row[place] = known.setdefault(row[place], len(known))
    words = {number: word for word, number in known.items()}
    return np.array(rows, np.float64), dict.fromkeys(places, words)


def _require_file(path: Path) -> None:
    """Raises InputFault for a device, a pipe or a folder, which may have no end."""
    if path.exists() and not path.is_file():
        raise InputFault(f"{path}: not a regular file: run the scene again")


def _find_malformed_line(path: Path) -> str:
    """The first line of a CSV that has a value too many or too few, or one that is no number."""
    with path.open(encoding="utf-8", errors="replace", newline="") as file:
        names, *lines = csv.reader(file)
    for number, values in enumerate(lines, 2):
        if len(values) != len(names):
            return f"line {number} has {len(values)} values, not {len(names)}"
        for name, value in zip(names, values, strict=True):
            try:
                float(value)
            except ValueError:
                return f"line {number}: {name} = {value!r} is no number"
    return ""
