"""Writes result files: the rows of a clock, and JSON atomically."""

from __future__ import annotations

import ctypes
import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.results import rows
from hapticlink.orchestrator.results.tables import Vector

ROOM = 1 << 16
"""Bytes of the rows that are kept in memory."""


class Recorder:
    """Writes a table: `time` and the values of a view. A context manager.

    at_once: each row is text in the CSV, and has been passed to the operating system, when `row`
    returns. Otherwise rows are kept in `block`, of which `count` are filled, and go to a file of
    doubles beside it (`rows`), of which `finish` makes the CSV: a crash loses those in the block.

    `last` is the time (s) of the last complete row on the disk, None before the first. `first` is
    called after the first and has to call `publish`, which moves the file to its place, `target`.
    """

    def __init__(
        self,
        path: Path,
        columns: Sequence[str],
        view: Vector,
        first: Callable[[], object],
        at_once: bool = True,
    ) -> None:
        self.path, self.view, self._first, self.at_once = path, view, first, at_once
        self.block = np.zeros((max(ROOM // (8 + view.nbytes), 1), 1 + len(view)))
        self.count = ctypes.c_int64()
        self.target = path if at_once else path.with_suffix(rows.SUFFIX)
        self.last: float | None = None
        self._unfinished = self._beside(self.target)
        self._file = self._unfinished.open("xb", buffering=0)  # never through a link
        try:
            self._write(",".join(["time", *map(_quoted, columns)]).encode() + b"\n")
        except OSError:
            self.__exit__()
            raise

    def row(self, time: float) -> None:
        """Write a row at `time` (s). Raises OSError, as on a full disk."""
        row = self.block[self.count.value]
        row[0], row[1:] = time, self.view
        self.count.value += 1
        if self.at_once or self.count.value == len(self.block):
            self.flush()

    def flush(self) -> None:
        """Write the rows of the block. Raises OSError, as on a full disk, after those that fit."""
        kept, self.count.value = self.block[: self.count.value], 0
        if not len(kept):
            return
        try:
            self._write(self._encoded(kept))
        except OSError:
            if len(kept) == 1:
                raise
            for i in range(len(kept)):
                self._write(self._encoded(kept[i : i + 1]))
                self._written(kept[i])
        else:
            self._written(kept[-1])

    def _encoded(self, kept: Vector) -> bytes:
        return rows.text(kept) if self.at_once else kept.tobytes()

    def _written(self, row: Vector) -> None:
        before, self.last = self.last, float(row[0])
        if before is None:
            self._first()

    def publish(self) -> None:
        """Replace the file of an earlier run by this one."""
        self._file.close()  # Windows moves no open file
        os.replace(self._unfinished, self.target)
        self._file = self.target.open("ab", buffering=0)

    def finish(self) -> None:
        """Make the CSV of the rows, and remove these. Raises OSError, as on a full disk, and keeps
        the rows."""
        if self.at_once or self.last is None:
            return
        self._file.close()
        made = self._beside(self.path)
        try:
            with made.open("xb") as file:
                rows.write_csv(self.target, file)
            os.replace(made, self.path)
        except OSError:
            made.unlink(missing_ok=True)
            raise
        self.target.unlink()

    @staticmethod
    def _beside(path: Path) -> Path:
        """The name of an unfinished file, which is not there."""
        unfinished = path.with_name(f".{path.name}.{os.getpid()}")
        unfinished.unlink(missing_ok=True)
        return unfinished

    def _write(self, content: bytes) -> None:
        """Write all of `content`; or nothing, raising OSError, where the disk is full."""
        whole = os.fstat(self._file.fileno()).st_size
        try:
            left = memoryview(content)
            while left:
                left = left[self._file.write(left) :]
        except OSError:
            with suppress(OSError):  # a device, such as /dev/full, has no length
                self._file.truncate(whole)
            raise

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()
        self._unfinished.unlink(missing_ok=True)


def _quoted(name: str) -> str:
    """A column name in CSV (RFC 4180): names of matrix entries contain a comma, those of FMUs
    any printable character."""
    doubled = name.replace('"', '""')
    return f'"{doubled}"' if "," in name or '"' in name else name


def write_json(path: Path, content: Mapping[str, Any], room: int = 0) -> None:
    """Write a JSON file atomically, padded by `room` spaces that `write_over` can use."""
    with atomic_file(path) as unfinished:
        unfinished.write_bytes(_text(content) + b" " * room)


def write_over(path: Path, *contents: Mapping[str, Any]) -> None:
    """Overwrite the file with the first of `contents` that fits into its present size, which works
    on a full disk, too; nothing if none fits."""
    with path.open("r+b", buffering=0) as file:
        room = os.fstat(file.fileno()).st_size
        fitting = (text for text in map(_text, contents) if len(text) <= room)
        if text := next(fitting, None):
            file.write(text.ljust(room))


def _text(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, indent=2).encode() + b"\n"
