"""Writes result files: the rows of a clock, and JSON atomically."""

from __future__ import annotations

import ctypes
import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.results import rows
from hapticlink.orchestrator.results.tables import Vector


class Recorder:
    """Keeps the rows of a table in memory: `time` and the `values` at `places`, named by `columns`,
    of every `every`-th row; without columns there is no table, and rows are counted only. A context
    manager.

    block: the newest rows, `room` of them at most, which `flush` moves to `parts`. `first` is
    called after the first row.

    `view` is `values` at `places` where these are side by side, else None. `due`: whether the next
    row is written. `room`: of the block, 0 until the first row is. `count`: rows so far, written or
    not. `reached`: time of the newest (s). They are shared with the compiled loop.
    """

    def __init__(
        self,
        columns: Sequence[str] | None,
        values: Vector,
        places: Sequence[int],
        first: Callable[[], object],
        every: int = 1,
        block: rows.Block | None = None,
    ) -> None:
        self.values, self.places, self.every = values, np.array(places, np.int64), every
        self.columns, self.parts = columns, list[Vector]()
        span = slice(places[0], places[-1] + 1) if len(places) else slice(0)
        beside = [*places] == [*range(len(values))[span]]
        self.view = values[span] if beside else None
        self._first = first
        self.due, self.room, self.count = (ctypes.c_int64(n) for n in (1, 0, 0))
        self.reached = ctypes.c_double()
        self.block = block

    @property
    def last(self) -> float | None:
        """The time (s) of the newest row, None before the first."""
        return self.reached.value if self.count.value else None

    def row(self, time: float) -> None:
        """Write a row at `time` (s). Raises OSError, as on a full disk."""
        if self.due.value and self.block:
            filled, rows = self.block.filled, self.block.rows
            if filled.value == len(rows):
                self.flush()
            row = rows[filled.value]
            row[0], row[1:] = time, self.values[self.places] if self.view is None else self.view
            filled.value += 1
        self.reached.value = time
        self.count.value += 1
        self.due.value = self.count.value % self.every == 0
        if self.count.value == 1:
            self._first()
            self.room.value = len(self.block.rows) if self.block else 1

    def flush(self) -> None:
        """Make room in the block for further rows."""
        if self.block and self.block.filled.value:
            self.parts.append(self.block.rows[: self.block.filled.value].copy())
            self.block.filled.value = 0

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to close."""


class FileRecorder(Recorder):
    """Writes a table to files: rows are kept in a block, which a crash of the process leaves
    (`rows.FileBlock`), and go to a file of doubles beside it, of which `finish` makes the CSV.
    `first` has to call `publish`, which moves that file to its place, `target`.
    """

    def __init__(
        self,
        path: Path,
        columns: Sequence[str] | None,
        values: Vector,
        places: Sequence[int],
        first: Callable[[], object],
        every: int = 1,
    ) -> None:
        super().__init__(columns, values, places, first, every)
        self.path, self.target = path, path.with_suffix(rows.SUFFIX)
        self._full: float | None = None
        self._file: BinaryIO | None = None
        if columns is None:
            return
        self.block: rows.FileBlock = rows.FileBlock(path, 1 + len(places))
        self._unfinished = self._beside(self.target)
        self._file = self._unfinished.open("xb", buffering=0)  # never through a link
        try:
            self._write(rows.header(("time", *columns)))
        except OSError:
            self.__exit__()
            raise

    @property
    def last(self) -> float | None:
        """As of all recorders, of the last row on the disk where that is full."""
        return super().last if self._full is None else self._full

    @property
    def files(self) -> list[str]:
        return [self.target.name, self.block.path.name] if self._file else []

    def flush(self) -> None:
        """Write the rows of the block. Raises OSError, as on a full disk, after those that fit."""
        if not self._file or not (filled := self.block.filled.value):
            return
        kept = self.block.rows[:filled]
        try:
            self._write(kept.data.cast("B"))
        except OSError:
            for row in kept:
                self._write(row.tobytes())
                self._full = float(row[0])
        finally:
            self.block.filled.value = 0

    def publish(self) -> None:
        """Replace the file of an earlier run by this one."""
        if self._file:
            self._file.close()  # Windows moves no open file
            os.replace(self._unfinished, self.target)
            self._file = self.target.open("ab", buffering=0)

    def finish(self) -> None:
        """Make the CSV of the rows, which stay. Raises OSError, as on a full disk."""
        if self._file and self.last is not None:
            self._file.close()
            make_csv(self.path)

    def remove(self) -> None:
        """Remove the rows."""
        if self._file and self.last is not None:
            remove_rows(self.path)

    @staticmethod
    def _beside(path: Path) -> Path:
        """The name of an unfinished file, which is not there."""
        unfinished = path.with_name(f".{path.name}.{os.getpid()}")
        unfinished.unlink(missing_ok=True)
        return unfinished

    def _write(self, content: bytes | memoryview) -> None:
        """Write all of `content`; or nothing, raising OSError, where the disk is full."""
        assert self._file
        whole = os.fstat(self._file.fileno()).st_size
        try:
            left = memoryview(content)
            while left:
                left = left[self._file.write(left) :]
        except OSError:
            with suppress(OSError):  # a device, such as /dev/full, has no length
                self._file.truncate(whole)
            raise

    def __exit__(self, *_: object) -> None:
        if self._file:
            self._file.close()
            self._unfinished.unlink(missing_ok=True)
            self.block.close()


def make_csv(path: Path) -> int:
    """Make the CSV `path` of its rows, which stay; their number. Raises OSError, as on a full
    disk."""
    source = path.with_suffix(rows.SUFFIX)
    with atomic_file(path) as unfinished, unfinished.open("xb") as file:
        count = rows.write_csv(source, file)
    return count


def remove_rows(path: Path) -> None:
    """Remove the rows of which the CSV `path` was made."""
    for left in (path.with_suffix(rows.SUFFIX), *rows.blocks(path)):
        left.unlink(missing_ok=True)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file atomically."""
    write(path, text(content))


def write(path: Path, content: bytes) -> None:
    """Write a file atomically."""
    with atomic_file(path) as unfinished:
        unfinished.write_bytes(content)


def write_over(path: Path, *contents: Mapping[str, Any]) -> None:
    """Overwrite the file with the first of `contents` that fits into its present size, which works
    on a full disk, too; nothing if none fits."""
    with path.open("r+b", buffering=0) as file:
        room = os.fstat(file.fileno()).st_size
        fitting = (content for content in map(text, contents) if len(content) <= room)
        if fits := next(fitting, None):
            file.write(fits.ljust(room))


def text(content: Mapping[str, Any]) -> bytes:
    """What a JSON file has of `content`."""
    return json.dumps(content, indent=2).encode() + b"\n"
