"""A table as it is written during a run: the header of its CSV, a line, then its rows as doubles of
this machine, in `<rate>.rows`. The newest rows are in the run's block (`Block`), a file that is
memory of the run at the same time. The CSV is made of both at the end of the run, or by `recover`.
"""

from __future__ import annotations

import csv
import ctypes
import mmap
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray
from pydantic_core import to_json

from hapticlink.orchestrator.base.faults import InputFault

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

    def __init__(self, room: int, width: int) -> None:
        self.filled, self.rows = ctypes.c_int64(), np.empty((room, width))


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
    count = 0
    with source.open("rb") as file:
        target.write(header(_columns(file.readline(), source)))
    for part in _parts(source):
        for first in range(0, len(part), step := max(AT_A_TIME // (8 * part.shape[1]), 1)):
            target.write(text(part[first : first + step]))
        count += len(part)
    return count


def read(path: Path) -> tuple[tuple[str, ...], Rows]:
    """The columns and the rows of a table; a row that is not whole is left out."""
    columns, pieces = parts(path)
    return columns, np.concatenate([np.zeros((0, len(columns))), *pieces])


def parts(path: Path) -> tuple[tuple[str, ...], Iterator[Rows]]:
    """The columns of a table, and its rows piece by piece."""
    with path.open("rb") as file:
        columns = _columns(file.readline(), path)
    return columns, _parts(path)


def count(path: Path) -> int:
    """The number of rows of a table that are whole, without those of its blocks."""
    with path.open("rb") as file:
        line = file.readline()
        return (os.fstat(file.fileno()).st_size - len(line)) // (8 * len(_columns(line, path)))


def torn(path: Path) -> int:
    """Number of rows of a table that were written in part: 1, if its last one was."""
    with path.open("rb") as file:
        line = file.readline()
        size = os.fstat(file.fileno()).st_size - len(line)
    return int(size % (8 * len(_columns(line, path))) > 0)


def blocks(table: Path) -> list[Path]:
    """The files of the blocks of a table."""
    return [*table.parent.glob(f".{table.stem}.*.block")]


def _parts(path: Path) -> Iterator[Rows]:
    """The rows of a table, piece by piece: those of the file, then those of its block that the file
    does not have."""
    last = -np.inf
    with path.open("rb") as file:
        width = len(_columns(file.readline(), path))
        while content := file.read(max(AT_A_TIME // (8 * width), 1) * 8 * width):
            if len(part := _rows(content, width)):
                last = part[-1, 0]
                yield part
    for block in blocks(path):
        with block.open("rb") as file:
            filled = int.from_bytes(file.read(COUNT), "little")
            part = _rows(file.read(filled * 8 * width), width)
            yield part[part[:, 0] > last]


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


def _rows(content: bytes, width: int) -> Rows:
    whole = len(content) // (8 * width)
    return np.frombuffer(content, np.float64, whole * width).reshape(whole, width)
