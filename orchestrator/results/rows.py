"""A table as it is written during a run: the header of its CSV, a line, then its rows as doubles of
this machine. The CSV is made of it at the end of the run."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray
from pydantic_core import to_json

SUFFIX = ".rows"
AT_A_TIME = 1 << 16
"""Bytes of rows that are made text at a time."""


def text(rows: NDArray[np.float64]) -> bytes:
    """Rows as CSV, each number as the shortest text that reads back to the same float."""
    # pydantic's JSON writes floats ten times faster than repr, and round-trips too.
    lines = to_json(rows.tolist(), inf_nan_mode="constants")
    return lines[2:-2].replace(b"],[", b"\n") + b"\n"


def write_csv(source: Path, target: BinaryIO) -> None:
    """Write the table `source` as CSV to `target`. A row that is not whole is left out."""
    with source.open("rb") as file:
        header = file.readline()
        target.write(header)
        width = len(_columns(header))
        while block := file.read(max(AT_A_TIME // (8 * width), 1) * 8 * width):
            if len(block) >= 8 * width:
                target.write(text(_rows(block, width)))


def read(path: Path) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """The columns and the rows of a table; a row that is not whole is left out."""
    with path.open("rb") as file:
        columns = _columns(file.readline())
        return columns, _rows(file.read(), len(columns))


def _columns(header: bytes) -> tuple[str, ...]:
    return tuple(next(csv.reader([header.decode()])))


def _rows(content: bytes, width: int) -> NDArray[np.float64]:
    whole = len(content) // (8 * width)
    return np.frombuffer(content, np.float64, whole * width).reshape(whole, width)
