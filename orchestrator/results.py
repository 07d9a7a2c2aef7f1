"""Results on disk: one CSV per rate, streamed, and `run.json`; and reading them back."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic_core import to_json

from hapticlink.orchestrator.faults import InputFault

Vector = NDArray[np.float64]


class Recorder:
    """Rows of one CSV: `time` and the values of a view, as the shortest text that reads back
    to the same float. A context manager. Each row is on its way to the disk when `row` returns, so
    that a crash loses none; chunks would save no time, which goes into the digits. `last` is the
    time of the last whole row."""

    def __init__(self, path: Path, columns: Sequence[str], view: Vector) -> None:
        self._view, self.last = view, 0.0
        self._file = path.open("wb", buffering=0)
        self._write(",".join(["time", *map(_quoted, columns)]).encode() + b"\n")

    def row(self, time: float) -> None:
        # pydantic's JSON writes floats ten times faster than repr, and round-trips too.
        text = to_json([time, *self._view.tolist()], inf_nan_mode="constants")
        self._write(text[1:-1] + b"\n")
        self.last = time

    def _write(self, text: bytes) -> None:
        """All of `text`; or nothing, where the disk is full."""
        whole = self._file.tell()
        try:
            left = memoryview(text)
            while left:
                left = left[self._file.write(left) :]
        except OSError:
            with suppress(OSError):  # what is no file, as /dev/full, has no length
                self._file.truncate(whole)
            raise

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


def _quoted(name: str) -> str:
    """Names of matrix entries hold a comma."""
    return f'"{name}"' if "," in name else name


def write_json(path: Path, content: Mapping[str, Any], room: int = 0) -> None:
    """Write whole or not at all; `room` bytes of spaces after it are for `write_over`."""
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        unfinished.write_bytes(_text(content) + b" " * room)
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def write_over(path: Path, *contents: Mapping[str, Any]) -> None:
    """Write the first of `contents` that fits over what is in the file, which asks no more room of
    a full disk; nothing where none fits."""
    with path.open("r+b", buffering=0) as file:
        room = os.fstat(file.fileno()).st_size
        fitting = (text for text in map(_text, contents) if len(text) <= room)
        if text := next(fitting, None):
            file.write(text.ljust(room))


def _text(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, indent=2).encode() + b"\n"


@dataclass(frozen=True)
class Table(Mapping[str, Vector]):
    """The columns of one rate. `table["device.x"]` stacks `device.x[1]`, `device.x[2]`, ...

    into (rows, n), a matrix into (rows, n, m); a full name gives its column, (rows,). `others` are
    the tables of the same run.
    """

    columns: tuple[str, ...]
    rows: Vector
    others: Mapping[str, Table] = field(default_factory=dict, repr=False, compare=False)

    def __getitem__(self, name: str) -> Vector:
        if name in self.columns:
            return self.rows[:, self.columns.index(name)]
        entries = [(i, c) for i, c in enumerate(self.columns) if c.startswith(f"{name}[")]
        if not entries:
            there = [other for other, table in self.others.items() if name in table]
            found = f"; it is in tables[{there[0]!r}]" if there else ""
            raise KeyError(f"no signal {name!r}{found}; there are {', '.join(self.columns)}")
        last = entries[-1][1]
        shape = tuple(int(n) for n in last[len(name) + 1 : -1].split(","))
        return self.rows[:, [i for i, _ in entries]].reshape(-1, *shape)

    def __contains__(self, name: object) -> bool:
        return any(c == name or c.startswith(f"{name}[") for c in self.columns)

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)


@dataclass(frozen=True)
class Results:
    """A run read back: `run` is run.json, `tables` the CSVs by rate."""

    folder: Path
    run: dict[str, Any]
    tables: dict[str, Table]

    @property
    def haptics(self) -> Table:
        return self.tables["haptics"]

    @property
    def graphics(self) -> Table:
        return self.tables["graphics"]


def load(folder: Path | str) -> Results:
    """Read a run's folder. Raises InputFault where it holds no run."""
    folder = Path(folder)
    try:
        run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as error:
        raise InputFault(f"{folder}: not the folder of a run: {error}") from error
    tables: dict[str, Table] = {}
    for name in run["rates"]:
        tables[name] = read_table(folder / f"{name}.csv", tables)
    return Results(folder, run, tables)


def read_table(path: Path, others: Mapping[str, Table] | None = None) -> Table:
    """One CSV of a run, whose other tables are `others`."""
    import csv

    with path.open(encoding="utf-8", newline="") as file:
        columns = tuple(next(csv.reader([file.readline()])))
        rows = file.readlines()
    values = np.loadtxt(rows, delimiter=",", ndmin=2) if rows else np.zeros((0, len(columns)))
    return Table(columns, values, {} if others is None else others)
