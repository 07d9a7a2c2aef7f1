"""A table as it is written during a run: the header of its CSV, a line, then its rows as doubles of
this machine, in `<rate>.rows`. The newest rows are in the run's block (`Block`), a file that is
memory of the run at the same time. The CSV is made of both at the end of the run, or by `recover`.
"""

from __future__ import annotations

import csv
import ctypes
import mmap
import os
from bisect import bisect_left, bisect_right
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray
from pydantic_core import to_json

from hapticlink.orchestrator.base.errors import InputFault

SUFFIX = ".rows"
AT_A_TIME = 1 << 16
"""Bytes of rows that are made text at a time."""
ROOM = 1 << 18
"""Bytes of the rows of a block: fewer calls of Python and of the file system than with 64 kB."""
COUNT = 8
"""Bytes of the number of rows, with which a block begins."""
Rows = NDArray[np.float64]


class Block:
    """The newest rows of a table, of `width` numbers: `filled` of `rows`."""

    def __init__(self, width: int) -> None:
        self.filled, self.rows = ctypes.c_int64(), np.empty((max(ROOM // (8 * width), 1), width))


class FileBlock(Block):
    """A block in a file that shares its memory, so that its rows outlive the process. Where the
    file system shares none they are in memory alone.

    Raises OSError, as on a full disk.
    """

    def __init__(self, table: Path, width: int) -> None:
        self.path = table.with_name(f".{table.stem}.{os.getpid()}.block")
        room = max(ROOM // (8 * width), 1)
        size = COUNT + room * 8 * width
        self.path.unlink(missing_ok=True)
        with self.path.open("xb+", buffering=0) as file:  # never through a link
            try:
                left = memoryview(bytes(size))  # on the disk, so that there is room for it
                while left:
                    left = left[file.write(left) :]
            except OSError:
                self.path.unlink()
                raise
            try:
                memory = mmap.mmap(file.fileno(), size)
            except OSError:
                memory = mmap.mmap(-1, size)
        self.filled = ctypes.c_int64.from_buffer(memory)
        self.rows = np.frombuffer(memory, np.float64, offset=COUNT).reshape(room, width)

    def close(self) -> None:
        """Remove the file, if all rows are in the table."""
        if not self.filled.value:
            with suppress(OSError):  # Windows removes no file that is mapped
                self.path.unlink(missing_ok=True)


def text(rows: Rows) -> bytes:
    """Rows as CSV, each number as the shortest text that reads back to the same float."""
    # pydantic's JSON, [[1.0,2.0],[3.0,4.0]], writes floats ten times faster than repr, and
    # round-trips too.
    lines = to_json(rows.tolist(), inf_nan_mode="constants").split(b"]")[:-2]
    return b"\n".join([line[2:] for line in lines]) + b"\n"


def header(columns: tuple[str, ...]) -> bytes:
    """The first line of a table, also of its CSV."""
    return ",".join(map(_quoted, columns)).encode() + b"\n"


def write_csv(source: Path, target: BinaryIO) -> int:
    """Write the table `source` as CSV to `target`; the number of its rows. A row that is not whole
    is left out."""
    table = Written(source)
    target.write(header(table.columns))
    step = max(AT_A_TIME // (8 * len(table.columns)), 1)
    for first in range(0, len(table), step):
        target.write(text(table[first : first + step]))
    return len(table)


class Written:
    """The rows of a table on the disk, read where they are asked for: those of its file that are
    whole, then those of its block that the file does not have.

    torn: whether a row of the file was written in part.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with path.open("rb") as file:
            self.columns = _columns(file.readline(), path)
            self._begin = file.tell()
            self._row = 8 * len(self.columns)
            size = os.fstat(file.fileno()).st_size - self._begin
        self._in_file, rest = divmod(size, self._row)
        self.torn = rest > 0
        self._newest = np.zeros((0, len(self.columns)))
        last = self.time(self._in_file - 1) if self._in_file else -np.inf
        for block in map(self._block, blocks(path)):
            self._newest = np.concatenate([self._newest, block[block[:, 0] > last]])

    def _block(self, path: Path) -> Rows:
        with path.open("rb") as file:
            filled = int.from_bytes(file.read(COUNT), "little")
            content = file.read(filled * self._row)
        whole = content[: len(content) // self._row * self._row]
        return np.frombuffer(whole).reshape(-1, len(self.columns))

    def __len__(self) -> int:
        return self._in_file + len(self._newest)

    def __getitem__(self, span: slice) -> Rows:
        first, last, _ = span.indices(len(self))
        count, begin = max(min(last, self._in_file) - first, 0), self._begin + first * self._row
        content = np.fromfile(self._path, count=count * len(self.columns), offset=begin)
        whole = content.reshape(count, len(self.columns))
        if last <= self._in_file:
            return whole
        newest = self._newest[max(first - self._in_file, 0) : last - self._in_file]
        return np.concatenate([whole, newest])

    def time(self, row: int) -> float:
        """The time (s) of a row."""
        return float(self[row : row + 1][0, 0])

    def between(self, begin: float, end: float) -> slice:
        """The rows of begin <= time <= end (s)."""
        first = bisect_left(range(len(self)), begin, key=self.time)
        return slice(first, bisect_right(range(len(self)), end, lo=first, key=self.time))


def blocks(table: Path) -> list[Path]:
    """The files of the blocks of a table."""
    return [*table.parent.glob(f".{table.stem}.*.block")]


def _columns(line: bytes, path: Path) -> tuple[str, ...]:
    try:
        return tuple(next(csv.reader([line.decode()])))
    except (csv.Error, UnicodeDecodeError, StopIteration) as error:
        raise InputFault(f"{path}: its header names no columns: {error}") from error


def _quoted(name: str) -> str:
    """A column name in CSV (RFC 4180): names of matrix entries contain a comma, those of FMUs
    any printable character."""
    doubled = name.replace('"', '""')
    return f'"{doubled}"' if "," in name or '"' in name else name
