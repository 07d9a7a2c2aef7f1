"""Result files while they are written: rows of a rate, JSON that is whole or not there."""

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
    """Rows of one CSV: `time` and the values of a view, as the shortest text that reads back
    to the same float. A context manager. Each row is on its way to the disk when `row` returns, so
    that a crash loses none; chunks would save no time, which goes into the digits. `last` is the
    time of the last whole row, None before the first.

    The file is in its place from `publish` on, which `first` is to see to: it is called when the
    first row is written."""

    def __init__(
        self, path: Path, columns: Sequence[str], view: Vector, first: Callable[[], object]
    ) -> None:
        self.path, self._view, self._first = path, view, first
        self.last: float | None = None
        self._unfinished = path.with_name(f".{path.name}.{os.getpid()}")
        self._file = self._unfinished.open("wb", buffering=0)
        try:
            self._write(",".join(["time", *map(_quoted, columns)]).encode() + b"\n")
        except OSError:
            self.__exit__()
            raise

    def row(self, time: float) -> None:
        # pydantic's JSON writes floats ten times faster than repr, and round-trips too.
        text = to_json([time, *self._view.tolist()], inf_nan_mode="constants")
        self._write(text[1:-1] + b"\n")
        before, self.last = self.last, time
        if before is None:
            self._first()

    def publish(self) -> None:
        """Put the file in the place of an earlier one."""
        self._file.close()  # Windows moves no open file
        os.replace(self._unfinished, self.path)
        self._file = self.path.open("ab", buffering=0)

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
        self._unfinished.unlink(missing_ok=True)


def _quoted(name: str) -> str:
    """Names of matrix entries hold a comma."""
    return f'"{name}"' if "," in name else name


def write_json(path: Path, content: Mapping[str, Any], room: int = 0) -> None:
    """Write whole or not at all; `room` bytes of spaces after it are for `write_over`."""
    with atomic_file(path) as unfinished:
        unfinished.write_bytes(_text(content) + b" " * room)


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
