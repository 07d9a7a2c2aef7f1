"""Reads results back: one CSV per rate, and `run.json`."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.faults import InputFault

Vector = NDArray[np.float64]


@dataclass(frozen=True, repr=False, eq=False)
class Table(Mapping[str, Vector]):
    """The samples of one rate by name: `table["device.x"]` stacks the columns `device.x[1]`,
    `device.x[2]`, ... into (rows, n), those of a matrix into (rows, n, m); the full name of a
    column gives that column, (rows,). Raises KeyError for an unknown name. `others` are the tables
    of the same run, for that message.
    """

    columns: tuple[str, ...]
    rows: Vector
    others: Mapping[str, Table] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Vector:
        if name in self.columns:
            return self.rows[:, self.columns.index(name)]
        entries = self._entries(name)
        if not entries:
            there = [other for other, table in self.others.items() if name in table]
            found = f"; it is in tables[{there[0]!r}]" if there else ""
            raise KeyError(f"no signal {name!r}{found}; there are {', '.join(self.columns)}")
        (first, _), (last, _) = entries[0], entries[-1]
        shape = tuple(b - a + 1 for a, b in zip(first, last, strict=False))
        if math.prod(shape) != len(entries):  # of an array with gaps, or names that form none
            shape = (len(entries),)
        return self.rows[:, [i for _, i in entries]].reshape(-1, *shape)

    def _entries(self, name: object) -> list[tuple[tuple[int, ...], int]]:
        """Indices and column of each entry of a vector or matrix, in the order of the indices: some
        tools write x[10] before x[2], or count from 0."""
        entry = re.compile(rf"{re.escape(str(name))}\[(\d+(?:, *\d+)*)\]")
        found = ((entry.fullmatch(c), i) for i, c in enumerate(self.columns))
        return sorted((tuple(map(int, m[1].split(","))), i) for m, i in found if m)

    def __contains__(self, name: object) -> bool:
        return name in self.columns or bool(self._entries(name))

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def __repr__(self) -> str:
        return fill(f"{len(self.rows)} rows of {', '.join(self.signals)}", 100)

    @property
    def signals(self) -> tuple[str, ...]:
        """The names of scalars, vectors and matrices, `time` the first."""
        return tuple(dict.fromkeys(column.partition("[")[0] for column in self.columns))


@dataclass(frozen=True, eq=False)
class Results:
    """The results of a run: `run` is run.json, `tables` the CSVs by rate; `folder` is None if it
    was run in memory."""

    folder: Path | None
    run: dict[str, Any]
    tables: dict[str, Table]

    @property
    def haptics(self) -> Table:
        """The Table of the haptic rate."""
        return self.tables["haptics"]

    @property
    def graphics(self) -> Table:
        """The Table of the graphics rate; KeyError where no FMU runs at it."""
        return self.tables["graphics"]


def size(folder: Path, run: Mapping[str, Any]) -> int:
    """Bytes of a run's tables."""
    return sum((folder / f"{name}.csv").stat().st_size for name in run["rates"])


def load(folder: Path | str) -> Results:
    """Reads a run's folder. Raises InputFault if it contains no run."""
    folder = Path(folder)
    tables: dict[str, Table] = {}
    try:
        run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        for name in run["rates"]:
            tables[name] = read_table(folder / f"{name}.csv", tables)
    except (OSError, ValueError, TypeError, KeyError) as error:
        why = f"{type(error).__name__}: {error}"
        raise InputFault(f"{folder}: not the folder of a run: {why}") from error
    return Results(folder, run, tables)


def read_table(path: Path, others: Mapping[str, Table] | None = None) -> Table:
    """Reads one CSV of a run; `others` are the run's other tables."""
    import csv

    with path.open(encoding="utf-8", newline="") as file:
        columns = tuple(next(csv.reader([file.readline()])))
        first = file.readline()
        rows = chain([first], file)  # the text of all of them would take twice what they take
        values = np.loadtxt(rows, delimiter=",", ndmin=2) if first else np.zeros((0, len(columns)))
    return Table(columns, values, {} if others is None else others)
