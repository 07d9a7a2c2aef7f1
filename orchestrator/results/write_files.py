"""Writes result files: the rows of a clock, and JSON atomically."""

from __future__ import annotations

import ctypes
import json
import os
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from itertools import starmap
from pathlib import Path
from typing import Any

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.base.errors import Fault
from hapticlink.orchestrator.fmi import transfer
from hapticlink.orchestrator.results import rows_file
from hapticlink.orchestrator.results.run_results import Recorder, TableRows


class FileRecorder(Recorder):
    """Writes a table to a file of rows, of which `finish` makes the CSV `path`. `first` has to call
    `publish`, which moves that file to its place, `target`.

    Raises OSError, as on a full disk.
    """

    def __init__(self, path: Path, of: TableRows, first: Callable[[], object]) -> None:
        self.path, self.target = path, path.with_suffix(rows_file.SUFFIX)
        self._unfinished = path.with_name(f".{self.target.name}.{os.getpid()}")
        if sys.platform == "win32":  # which moves no open file
            self._unfinished = self.target
        self._file: rows_file.RowsBeingWritten | None = None
        self._published, self._full = False, 0.0
        super().__init__(of, first)

    def _new_rows(self, recorded: bool, most: int) -> tuple[Vector | None, ctypes.c_int64]:
        if not recorded:
            return super()._new_rows(recorded, most)
        self.files = (self.target.name,)
        self._unfinished.unlink(missing_ok=True)
        self._file = rows_file.RowsBeingWritten(self._unfinished, self.columns, most)
        return self._file.rows, self._file.filled

    @property
    def last(self) -> float | None:
        """As of all recorders, of the last row in the file where the disk is full."""
        return self._full or super().last

    def _make_room(self) -> int:
        if self._file is None or self.rows is None:
            return super()._make_room()
        if (filled := self.filled.value) == self._file.reserved:
            try:
                self._file.reserve()
            except OSError:
                self._full = float(self.rows[filled - 1, 0])
                raise
        if self.room.value:
            self.room.value = self._file.reserved
        return self._file.reserved

    def publish(self) -> None:
        if self._file:
            self._publish_texts()
            if self._unfinished != self.target:
                os.replace(self._unfinished, self.target)
                self._file.path = self.target
            self._published = True

    def _publish_texts(self) -> None:
        """Write the texts of this process beside the rows, each further one before it is in a
        row, for a run that is killed."""
        self.path.with_suffix(rows_file.TEXTS).unlink(missing_ok=True)
        if self.texts:
            self._write_texts({})
            transfer.follow_texts(self._add_text)

    def _write_texts(self, texts: Mapping[int, bytes]) -> None:
        lines = [json.dumps(self.texts) + "\n", *starmap(rows_file.text_line, texts.items())]
        write_atomically(self.path.with_suffix(rows_file.TEXTS), "".join(lines).encode())

    def _add_text(self, number: int, text: bytes) -> None:
        with self.path.with_suffix(rows_file.TEXTS).open("a") as file:
            file.write(rows_file.text_line(number, text))

    def finish(self) -> None:
        if self._published and not self.is_awaited:
            table = rows_file.RowsFile(self.target)
            make_csv(self.path, table)
            self._require_rows(table)

    def require_whole(self) -> None:
        if self._published and not self.is_awaited:
            table = rows_file.RowsFile(self.target)
            self._require_rows(table)
            transfer.leave_texts(self._add_text)
            if self.texts:  # of the process as yet
                numbers = rows_file.text_numbers(table.blocks(), self.texts)
                self._write_texts(transfer.known_texts(numbers))

    def _require_rows(self, table: rows_file.RowsFile) -> None:
        if (written := len(table)) != self.recorded:
            raise Fault(
                f"{self.path}: {written} rows, where {self.recorded} were recorded: somebody else "
                "wrote there; take another folder, and isolate = true if an FMU may have done it"
            )

    def discard(self) -> None:
        """Remove the rows, where they are not published."""
        if not self._published:
            with suppress(OSError):
                self._unfinished.unlink(missing_ok=True)

    def __exit__(self, *_: object) -> None:
        transfer.leave_texts(self._add_text)
        if self._file:
            self.rows, self.filled = None, ctypes.c_int64()
            self._file.close()
            self.discard()


def make_csv(path: Path, table: rows_file.RowsFile) -> None:
    """Make the CSV `path` of its rows, which stay. Raises OSError, as on a full disk."""
    with atomic_file(path) as unfinished, unfinished.open("xb") as file:
        rows_file.write_csv(table, file)


def remove_rows(path: Path) -> None:
    """Remove the rows of which the CSV `path` was made."""
    with suppress(PermissionError):  # of Windows, where somebody still has them mapped
        for suffix in (rows_file.SUFFIX, rows_file.TEXTS):
            path.with_suffix(suffix).unlink(missing_ok=True)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file atomically."""
    write_atomically(path, text(content))


def write_atomically(path: Path, content: bytes) -> None:
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
