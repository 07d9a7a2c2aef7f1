"""Writes result files: the rows of a clock, and JSON atomically."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from hapticlink.fmus.atomic_file import atomic_file
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.results import binary_rows
from hapticlink.orchestrator.results.run_results import Recorder


class FileRecorder(Recorder):
    """Writes a table to files: rows are kept in a block, which a crash of the process leaves
    (`binary_rows.FileBlock`), and go to a file of doubles beside it, of which `finish` makes the
    CSV.
    `first` has to call `publish`, which moves that file to its place, `target`.
    """

    def __init__(
        self,
        path: Path,
        recorded: Mapping[str, int] | None,
        values: Vector,
        first: Callable[[], object],
        every: int = 1,
        end: int = 0,
    ) -> None:
        super().__init__(recorded, values, first, every, end)
        self.path, self.target = path, path.with_suffix(binary_rows.SUFFIX)
        self._full: float | None = None
        self._file: BinaryIO | None = None
        if recorded is None:
            return
        self.block: binary_rows.FileBlock = binary_rows.FileBlock(path, len(self.columns))
        self.files = (self.target.name, self.block.path.name)
        self._unfinished = path.with_name(f".{self.target.name}.{os.getpid()}")
        self._unfinished.unlink(missing_ok=True)
        self._file = self._unfinished.open("xb", buffering=0)  # never through a link
        try:
            self._write(binary_rows.header(self.columns))
        except OSError:
            self.__exit__()
            raise

    @property
    def last(self) -> float | None:
        """As of all recorders, of the last row on the disk where that is full."""
        return super().last if self._full is None else self._full

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
        if self._file:
            self._file.close()  # Windows moves no open file
            os.replace(self._unfinished, self.target)
            self._file = self.target.open("ab", buffering=0)

    def finish(self) -> None:
        if self._file and self.last is not None:
            self._file.close()
            make_csv(self.path)

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
    source = path.with_suffix(binary_rows.SUFFIX)
    with atomic_file(path) as unfinished, unfinished.open("xb") as file:
        count = binary_rows.write_csv(source, file)
    return count


def remove_rows(path: Path) -> None:
    """Remove the rows of which the CSV `path` was made."""
    for left in (path.with_suffix(binary_rows.SUFFIX), *binary_rows.blocks(path)):
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
