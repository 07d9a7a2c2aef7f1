"""Finished rows on disk, so that an interrupted benchmark can be continued."""

from __future__ import annotations

import csv
import statistics
from collections.abc import Sequence
from pathlib import Path


class Rows:
    """Rows of one CSV file, each known by its first `keys` columns; appended and flushed."""

    def __init__(self, path: Path, columns: tuple[str, ...], keys: int) -> None:
        self.path, self.columns, self.keys = path, columns, keys
        self.rows: dict[tuple[str, ...], dict[str, str]] = {}
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists():
            with path.open(newline="") as file:
                read = csv.DictReader(file)
                if tuple(read.fieldnames or ()) != columns:
                    raise ValueError(f"{path}: columns of another version; move it away")
                for row in read:
                    self.rows[tuple(row[c] for c in columns[:keys])] = row
        else:
            with path.open("w", newline="") as file:
                csv.writer(file).writerow(columns)

    def __contains__(self, key: tuple[object, ...]) -> bool:
        return tuple(map(str, key)) in self.rows

    def add(self, *values: object) -> None:
        flat = [repr(v) if isinstance(v, float) else str(v) for v in values]
        with self.path.open("a", newline="") as file:
            csv.writer(file).writerow(flat)
        self.rows[tuple(flat[: self.keys])] = dict(zip(self.columns, flat, strict=True))


def quartiles(values: Sequence[float]) -> tuple[float, float, float]:
    if len(values) < 2:
        return (values[0],) * 3
    first, middle, third = statistics.quantiles(values, n=4, method="inclusive")
    return first, middle, third
