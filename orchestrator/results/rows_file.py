"""A table as an array in a file, `<rate>.rows`: the header of its CSV, a line; the number of its
rows, 8 bytes at the next multiple of 8; then the rows, doubles of this machine.

A run writes its rows through a map of the file: whatever ends its process, the file has them all.
Texts are in it as numbers, and beside it in `<rate>.texts`: a line with the FMI types of those
columns, by their places, then a line for each number with the bytes of its text.
"""

from __future__ import annotations

import csv
import ctypes
import errno
import json
import mmap
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from io import FileIO
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray
from pydantic_core import SchemaSerializer, core_schema

from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.fmi.transfer import shown

SUFFIX, TEXTS = ".rows", ".texts"
AT_A_TIME = 1 << 16
"""Bytes of rows that are made text at a time."""
RESERVED = 1 << 18
"""Bytes that a file grows by: fewer calls of Python and of the file system than with 64 kB."""
MAX_HEADER = 1 << 28
"""Bytes of the names of a table's columns."""
COUNT = 8
"""Bytes of the number of rows."""
Rows = NDArray[np.float64]
_as_json = SchemaSerializer(
    core_schema.list_schema(core_schema.float_schema()), {"ser_json_inf_nan": "constants"}
).to_json


class RowsFile:
    """The rows of a table in a file, of which those that are asked for are mapped.

    Raises InputFault for a file whose header names no columns, `time` the first.
    """

    def __init__(self, path: Path) -> None:
        self._path, self.texts = path, read_texts(path.with_suffix(TEXTS))
        with path.open("rb") as file:
            line = file.readline(MAX_HEADER)
            self.columns = _columns(line, path)
            self._begin = _data(line)
            file.seek(self._begin - COUNT)
            count = int.from_bytes(file.read(COUNT), "little", signed=True)
            whole = (os.fstat(file.fileno()).st_size - self._begin) // (8 * len(self.columns))
        self._count = max(min(count, whole), 0)

    def keep_ordered(self) -> int:
        """Leave out the rows from the first on whose time is not finite or before that of the row
        above, as a machine that failed may leave them; their number."""
        before, last = self._count, -np.inf
        step = max(AT_A_TIME // (8 * len(self.columns)), 1)
        for first in range(0, before, step):
            times = self[first : first + step][:, 0]
            good = np.isfinite(times) & (times >= np.r_[last, times[:-1]])
            if not good.all():
                self._count = first + int(good.argmin())
                break
            last = times[-1]
        return before - self._count

    def blocks(self) -> Iterator[Rows]:
        """The rows, some at a time."""
        step = max(AT_A_TIME // (8 * len(self.columns)), 1)
        return (self[first : first + step] for first in range(0, self._count, step))

    def __len__(self) -> int:
        return self._count

    @property
    def size(self) -> int:
        """Bytes of the rows."""
        return 8 * self._count * len(self.columns)

    def __array__(self, *_: object, **how: object) -> Rows:
        return self[:]

    def __getitem__(self, span: slice) -> Rows:
        first, last, _ = span.indices(self._count)
        shape = max(last - first, 0), len(self.columns)
        if not shape[0]:
            return np.zeros(shape)
        begin, size = self._begin + 8 * first * shape[1], 8 * shape[0] * shape[1]
        before = begin % mmap.ALLOCATIONGRANULARITY
        with self._path.open("rb") as file:
            memory = mmap.mmap(
                file.fileno(), before + size, access=mmap.ACCESS_READ, offset=begin - before
            )
        # Not numpy.memmap, which looks at each slice and result whether it is of the file.
        return np.frombuffer(memory, np.float64, size // 8, before).reshape(shape)

    def read(self) -> Rows:
        """All rows, in memory."""
        count = self._count * len(self.columns)
        return np.fromfile(self._path, count=count, offset=self._begin).reshape(
            self._count, len(self.columns)
        )


class RowsBeingWritten:
    """A file of up to `most` rows, into which a run writes: `rows` are all that it can have, of
    which the first `filled` are written and the first `reserved` have their place on the disk.

    `path` is where it is. No descriptor of it stays open: FMUs share those of a process, and one
    that closes what is not its own would have rows written into whatever is opened next.

    Raises OSError, as on a full disk, and where there is a file already.
    """

    def __init__(self, path: Path, columns: tuple[str, ...], most: int) -> None:
        line = header(columns)
        self._begin, self._row = _data(line), 8 * len(columns)
        self.path, self.reserved = path, 0
        with path.open("xb+", buffering=0) as file:  # never through a link
            self._identity = _identify(file)
            try:
                file.write(line.ljust(self._begin - COUNT, b"\n") + bytes(COUNT))
                self._memory = self._map(file, max(most, 1))
                self._reserve(file)
            except OSError:
                path.unlink()
                raise
        self.filled = ctypes.c_int64.from_buffer(self._memory, self._begin - COUNT)
        flat = np.frombuffer(self._memory, np.float64, offset=self._begin)
        self.rows: Rows = flat.reshape(-1, len(columns))

    def _map(self, file: FileIO, most: int) -> mmap.mmap:
        """The file in memory, with room for `most` rows or, where files are not that long (4 GB on
        FAT, 16 TB on ext4), for half of them, a quarter and so on."""
        size = self._begin + most * self._row
        try:
            file.truncate(size)
            return mmap.mmap(file.fileno(), size)
        except (OSError, OverflowError):
            if most == 1:
                raise
            return self._map(file, most // 2)

    def reserve(self) -> None:
        """Have a place on the disk for further rows. Raises OSError where not one more fits, and
        where another file has taken the place of this one."""
        with self._reopen() as file:
            self._reserve(file)

    @contextmanager
    def _reopen(self) -> Iterator[FileIO]:
        with self.path.open("rb+", buffering=0) as file:
            if _identify(file) != self._identity:
                what = "another file has taken the place of the rows of a run"
                raise OSError(errno.EEXIST, what, str(self.path))
            yield file

    def _reserve(self, file: FileIO) -> None:
        begin = self._begin + self.reserved * self._row
        if begin == len(self._memory):
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
        file.seek(begin)
        left = memoryview(bytes(min(max(RESERVED, self._row), len(self._memory) - begin)))
        with suppress(OSError):
            while left:
                left = left[file.write(left) :]
        if (more := (file.tell() - begin) // self._row) == 0:
            file.write(left)  # which says why
        self.reserved += more
        with suppress(AttributeError, OSError):  # not on Windows, nor where memory is locked
            self._memory.madvise(mmap.MADV_DONTNEED)  # rows that are written need no memory

    def close(self) -> None:
        """The file ends with its last row. Nothing may write rows any more."""
        size = self._begin + self.filled.value * self._row
        del self.rows, self.filled
        with suppress(BufferError):  # somebody else still has them
            self._memory.close()
        with suppress(OSError), self._reopen() as file:  # Windows shortens none that is mapped
            file.truncate(size)


def _identify(file: FileIO) -> tuple[int, int]:
    """What tells an open file from all others."""
    status = os.fstat(file.fileno())
    return status.st_dev, status.st_ino


Texts = Mapping[int, Mapping[int, str]]
"""By the place of a column that is a text, the texts of its numbers."""
NO_TEXTS: Texts = MappingProxyType({})


def text(rows: Rows, texts: Texts = NO_TEXTS) -> bytes:
    """Rows as CSV, each number as the shortest text that reads back to the same float, each text in
    quotes."""
    # pydantic's JSON, [1.0,2.0], writes floats ten times faster than repr, and round-trips too.
    lines = (_as_json(row.tolist())[1:-1] for row in rows)
    if texts:
        lines = (_with_texts(line, row, texts) for line, row in zip(lines, rows, strict=True))
    return b"".join([b"%b\n" % line for line in lines])


def _with_texts(line: bytes, row: Rows, texts: Texts) -> bytes:
    cells = line.split(b",")
    for place, words in texts.items():
        cells[place] = b'"%b"' % words[int(row[place])].replace('"', '""').encode()
    return b",".join(cells)


def text_line(number: int, text: bytes) -> str:
    """The line of `<rate>.texts` that has a text."""
    return f"{number} {text.hex()}\n"


def text_numbers(rows: Iterable[Rows], places: Iterable[int]) -> Iterator[float]:
    """The numbers of the texts in blocks of rows, which are at these places."""
    return chain.from_iterable(block[:, [*places]].ravel().tolist() for block in rows)


def read_texts(path: Path) -> Texts:
    """Of a file of texts; none where there is no such file. Its last line may be cut."""
    if not path.exists():
        return NO_TEXTS
    types, *lines = path.read_text().splitlines(keepends=True)
    cells = (line.split(" ") for line in lines if line.endswith("\n"))
    known = {int(number): bytes.fromhex(text) for number, text in cells}
    return name_texts({int(i): type_ for i, type_ in json.loads(types).items()}, known)


def name_texts(types: Mapping[int, str], known: Mapping[int, bytes]) -> Texts:
    """By the places of columns of these FMI types, the texts that are known, as tables have
    them."""
    of = {type_: {n: shown(text, type_) for n, text in known.items()} for type_ in types.values()}
    return {place: of[type_] for place, type_ in types.items()}


def header(columns: tuple[str, ...]) -> bytes:
    """The first line of a table, also of its CSV."""
    return ",".join(map(_quote, columns)).encode() + b"\n"


def write_csv(table: RowsFile, target: BinaryIO) -> None:
    """Write a table as CSV to `target`."""
    target.write(header(table.columns))
    for rows in table.blocks():
        target.write(text(rows, table.texts))


def write_empty(path: Path, columns: tuple[str, ...], as_csv: bool) -> None:
    """Write a table without rows, as a CSV or as a file of rows."""
    line = header(columns)
    path.write_bytes(line if as_csv else line.ljust(_data(line) - COUNT, b"\n") + bytes(COUNT))


def _data(line: bytes) -> int:
    """Where the rows begin behind a header, the number of rows in between."""
    return -(-len(line) // COUNT) * COUNT + COUNT


def _columns(line: bytes, path: Path) -> tuple[str, ...]:
    try:
        columns = tuple(next(csv.reader([line.decode()]), ()))
    except (csv.Error, UnicodeDecodeError) as error:
        raise InputFault(f"{path}: its header names no columns: {error}") from error
    if columns[:1] != ("time",):
        first = columns[0][:40] if columns else ""
        raise InputFault(f"{path}: its first column is {first!r}, not 'time'")
    return columns


def _quote(name: str) -> str:
    """A column name in CSV (RFC 4180): names of matrix entries contain a comma, those of FMUs
    any printable character."""
    doubled = name.replace('"', '""')
    return f'"{doubled}"' if "," in name or '"' in name else name
