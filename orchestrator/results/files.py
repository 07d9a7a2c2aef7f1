"""Writes result files: the rows of a clock as CSV, and JSON atomically."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic_core import to_json

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.results.tables import Vector


class Recorder:
    """Writes one CSV: `time` and the values of a view, as the shortest text that reads back to the
    same float. A context manager.

    Each row has been passed to the operating system when `row` returns, so that a crash loses none;
    buffering would save no time, which is spent on formatting. `last` is the time (s) of the last
    complete row, None before the first. `first` is called after the first row and has to call
    `publish`, which moves the file to its place.

    pending: takes the rows (k, 1 + n) that the compiled loop has recorded since the last `flush`,
    if it records them; `at_once` it does not.
    """

    def __init__(
        self,
        path: Path,
        columns: Sequence[str],
        view: Vector,
        first: Callable[[], object],
        at_once: bool = False,
    ) -> None:
        self.path, self.view, self._first, self.at_once = path, view, first, at_once
        self.pending: Callable[[], Vector] | None = None
        self.last: float | None = None
        self._unfinished = path.with_name(f".{path.name}.{os.getpid()}")
        self._unfinished.unlink(missing_ok=True)
        self._file = self._unfinished.open("xb", buffering=0)  # never through a link
        try:
            self._write(",".join(["time", *map(_quoted, columns)]).encode() + b"\n")
        except OSError:
            self.__exit__()
            raise

    def row(self, time: float) -> None:
        """Write a row at `time` (s). Raises OSError, as on a full disk."""
        self._rows([[time, *self.view.tolist()]])

    def flush(self) -> None:
        """Write the rows that are pending: all, or as many as the disk has room for, raising
        OSError."""
        if self.pending is None:
            return
        rows = self.pending().tolist()
        try:
            self._rows(rows)
        except OSError:
            for row in rows:
                self._rows([row])

    def _rows(self, rows: list[list[float]]) -> None:
        if not rows:
            return
        # pydantic's JSON writes floats ten times faster than repr, and round-trips too.
        text = to_json(rows, inf_nan_mode="constants")
        self._write(text[2:-2].replace(b"],[", b"\n") + b"\n")
        before, self.last = self.last, rows[-1][0]
        if before is None:
            self._first()

    def publish(self) -> None:
        """Replace the file of an earlier run by this one."""
        self._file.close()  # Windows moves no open file
        os.replace(self._unfinished, self.path)
        self._file = self.path.open("ab", buffering=0)

    def _write(self, text: bytes) -> None:
        """Write all of `text`; or nothing, raising OSError, where the disk is full."""
        whole = self._file.tell()
        try:
            left = memoryview(text)
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
