"""Reads results back: one CSV per rate, and `run.json`."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain, islice
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.variables import entry_of
from hapticlink.orchestrator.results import binary_rows, run_record
from hapticlink.orchestrator.results.run_record import RunRecord

TABLES = (".csv", binary_rows.SUFFIX)
"""Endings of the names of tables."""


@dataclass(frozen=True, repr=False, eq=False)
class Table(Mapping[str, Vector]):
    """The samples of one rate by name: `table["device.x"]` stacks the columns `device.x[1]`,
    `device.x[2]`, ... into (rows, n), those of a matrix into (rows, n, m), by their indices,
    whichever column comes first; entries with gaps between them into (rows, k). The full name of a
    column gives that column, (rows,). Raises KeyError for an unknown name. `others` are the tables
    of the same run, for that message. Rows of a window begin with the `first` of `of` in all.
    """

    columns: tuple[str, ...]
    rows: Vector
    others: Mapping[str, Table] = field(default_factory=dict)
    first: int = 0
    of: int | None = None

    def __getitem__(self, name: str) -> Vector:
        if (place := self._places.get(name)) is not None:
            return self.rows[:, place]
        if name not in self._arrays:
            there = [other for other, table in self.others.items() if name in table]
            hint = f"; it is in tables[{there[0]!r}]" if there else ""
            raise KeyError(f"no signal {name!r}{hint}; there are {', '.join(self.columns)}")
        places, shape = self._arrays[name]
        return self.rows[:, places].reshape(-1, *shape)

    def shape(self, name: str) -> tuple[int, ...]:
        """The shape of a sample of a signal, which is here."""
        return () if name in self._places else self._arrays[name][1]

    @cached_property
    def _places(self) -> dict[str, int]:
        return {column: place for place, column in reversed([*enumerate(self.columns)])}

    @cached_property
    def _arrays(self) -> dict[str, tuple[tuple[int, ...], tuple[int, ...]]]:
        """The columns of the entries of each vector and matrix, and its shape."""
        entries: dict[str, list[tuple[tuple[int, ...], int]]] = {}
        for place, column in enumerate(self.columns):
            name, indices = entry_of(column)
            if indices:
                entries.setdefault(name, []).append((indices, place))
        ordered = {name: zip(*sorted(each), strict=True) for name, each in entries.items()}
        return {name: (places, _shape(indices)) for name, (indices, places) in ordered.items()}

    def __contains__(self, name: object) -> bool:
        return name in self._places or name in self._arrays

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    @property
    def total(self) -> int:
        """The number of rows of the whole run."""
        return len(self.rows) if self.of is None else self.of

    def __repr__(self) -> str:
        return fill(f"{len(self.rows)} rows of {', '.join(self.signals)}", 100)

    @property
    def signals(self) -> tuple[str, ...]:
        """The names of scalars, vectors and matrices, `time` the first."""
        return tuple(dict.fromkeys(entry_of(column)[0] for column in self.columns))


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
    was run in memory. Where they are a window of the run, the rows of `begin` < time <= `end` (s)
    are meant, and those beside them are for interpolation."""

    folder: Path | None
    run: dict[str, Any]
    tables: Mapping[str, Table]
    begin: float = -math.inf
    end: float = math.inf

    @property
    def number(self) -> int:
        """The number of `windows`."""
        return 1

    def windows(self) -> Iterator[Results]:
        """The windows of time that follow each other, of which these results consist: themselves,
        but of a run that is too long to be read at once."""
        yield self

    def within(self, times: Vector) -> slice:
        """The rows of ordered times (s) that are meant."""
        return slice(
            int(np.searchsorted(times, self.begin, "right")),
            int(np.searchsorted(times, self.end, "right")),
        )

    def has_rows_of(self, other: Results) -> bool:
        """Whether both recorded the same signals with the same numbers."""
        pairs = ((self.tables[n], other.tables[n]) for n in self.tables if n in other.tables)
        return [*self.tables] == [*other.tables] and all(
            mine.columns == its.columns and np.array_equal(mine.rows, its.rows, equal_nan=True)
            for mine, its in pairs
        )

    @cached_property
    def record(self) -> RunRecord:
        """The content of run.json as a record. Raises InputFault where it is of another version, or
        was changed."""
        return run_record.read(self.run, self.folder)

    @property
    def haptics(self) -> Table:
        """The Table of the haptic rate."""
        return self.tables["haptics"]

    @property
    def graphics(self) -> Table:
        """The Table of the graphics rate; KeyError where no FMU runs at it."""
        return self.tables["graphics"]


def described(results: Results, record: RunRecord) -> Results:
    """Results whose `record` is known without reading it from `run`."""
    vars(results)["record"] = record
    return results


def size(folder: Path, run: Mapping[str, Any], binary: bool = False) -> int:
    """Bytes of a run's tables, `binary` where they are there so."""
    tables = (folder / name for name in run["files"] if name.endswith(TABLES))
    return sum(_place(path, binary).stat().st_size for path in tables)


def _place(path: Path, binary: bool = False) -> Path:
    """Where a table is: a CSV, or what it is made of where the run was killed, or where that is
    wanted (`binary`) and still there."""
    left = path.with_suffix(binary_rows.SUFFIX)
    return left if left.exists() and (binary or not path.exists()) else path


class FolderTables(Mapping[str, Table]):
    """The tables of a run's folder by rate, each read when it is asked for and kept then. `binary`:
    from the rows where they are still there."""

    def __init__(
        self, folder: Path, rates: Sequence[str], files: Sequence[str], binary: bool = False
    ) -> None:
        self._folder, self._rates, self._files, self._binary = folder, rates, files, binary
        self._read: dict[str, Table] = {}

    def __getitem__(self, rate: str) -> Table:
        if rate not in self._rates:
            raise KeyError(rate)
        if rate not in self._read:
            there = recorded(rate, self._files)
            path = self._folder / f"{rate}.csv"
            self._read[rate] = read_table(path, self, self._binary) if there else empty(self)
        return self._read[rate]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rates)

    def __len__(self) -> int:
        return len(self._rates)


def load(folder: Path | str, binary: bool = False, record: RunRecord | None = None) -> Results:
    """Reads a run's folder; `binary`: from the rows where they are still there. record: the content
    of its run.json, where it is known. Raises InputFault if it contains no run, one of another
    version, or one that was changed."""
    folder = Path(folder)
    run = run_json(folder)
    record = record or run_record.read(run, folder)
    tables = FolderTables(folder, record.rates, record.files, binary)
    return described(Results(folder, run, dict(tables)), record)


def run_json(folder: Path) -> dict[str, Any]:
    """The content of the run.json of a run's folder. Raises InputFault where there is none."""
    try:
        content: dict[str, Any] = text_files.read_json(folder / "run.json")
    except InputFault as error:
        raise InputFault(f"{folder}: not the folder of a run: {error}") from error
    return content


def recorded(rate: str, files: Sequence[str]) -> bool:
    """Whether a rate has a table among the files of a run."""
    return any(rate + suffix in files for suffix in TABLES)


def empty(others: Mapping[str, Table]) -> Table:
    """The table of a rate of which nothing is recorded."""
    return Table(("time",), np.zeros((0, 1)), others)


def read_table(
    path: Path, others: Mapping[str, Table] | None = None, binary: bool = False
) -> Table:
    """Reads one CSV of a run, or its rows where the run was killed; `others` are the run's other
    tables. Raises InputFault for a table that is not as a run writes it."""
    if (place := _place(path, binary)) != path:
        _require_file(place)
        written = binary_rows.Written(place)
        return Table(written.columns, written[:], {} if others is None else others)
    (columns, values), *_ = csv_parts(path)
    return Table(columns, values, {} if others is None else others)


def csv_parts(path: Path, most: int | None = None) -> Iterator[tuple[tuple[str, ...], Vector]]:
    """The columns of a CSV of a run, with its rows, or with those of about `most` bytes as doubles
    at a time. Raises InputFault for a table that is not as a run writes it."""
    _require_file(path)
    line, last = 2, -math.inf
    try:
        with path.open(encoding="utf-8", newline="") as file:
            columns = tuple(next(csv.reader([file.readline()])))
            if columns[:1] != ("time",):
                why = f"its first column is {columns[0] if columns else ''!r}, not 'time'"
                raise InputFault(f"{path}: line 1: {why}: run the scene again")
            count = most and max(most // (8 * len(columns)), 1)
            while first := file.readline():
                # The text of all lines would take twice what they take.
                lines = chain([first], islice(file, count and count - 1))
                values = np.loadtxt(lines, delimiter=",", ndmin=2)
                if values.shape[1] != len(columns):
                    raise ValueError
                ordered = np.diff(values[:, 0], prepend=last) >= 0
                if not ordered.all():
                    late = int(ordered.argmin())
                    why = f"time = {values[late, 0]:g} s is before that of the line above"
                    raise InputFault(f"{path}: line {line + late}: {why}: run the scene again")
                yield columns, values
                line, last = line + len(values), values[-1, 0]
            if line == 2:
                yield columns, np.zeros((0, len(columns)))
    except OSError as error:
        raise InputFault(f"{path}: {error.strerror}: run the scene again") from error
    except csv.Error as error:  # a line without end
        raise InputFault(f"{path}: {error}: run the scene again") from error
    except ValueError as error:
        raise InputFault(f"{path}: {_malformed(path) or error}: run the scene again") from error


def _require_file(path: Path) -> None:
    """Raises InputFault for a device, a pipe or a folder, which may have no end."""
    if path.exists() and not path.is_file():
        raise InputFault(f"{path}: not a regular file: run the scene again")


def _malformed(path: Path) -> str:
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
