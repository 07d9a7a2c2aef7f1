"""A recorded log in the place of a table over time, of a hand, a drive or a signal:

    [hand]
    type = "profile"
    table = { path = "log.csv", columns = ["t", "Fx", "Fy", "Tz"], units = ["ms", "N", "N", "N.m"] }

The file is a CSV of numbers; a first line that is none has the names of its columns. The times of a
signal are those of the run; the first row of a hand or drive is at the run's start. A column that
is named `F` stands for `F[1]`, `F[2]`, ... where these are there, so that a run's own `haptics.csv`
is a log: columns = ["time", "hand.F"].
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from decimal import Decimal
from itertools import count, takewhile, zip_longest
from pathlib import Path
from typing import Any

from hapticlink.fmus.errors import InvalidUnit
from hapticlink.fmus.units import base_unit
from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import unknown
from hapticlink.orchestrator.scene.toml_keys import Path as Keys
from hapticlink.orchestrator.scene.toml_keys import entries, tables_of_users, value

LARGEST = 2**26
"""Bytes: 10 min at 1 kHz, of four columns."""
UNITS = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6},
    "rad": {"rad": 1.0, "deg": math.pi / 180},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "N.m": {"N.m": 1.0, "mN.m": 1e-3, "N.mm": 1e-3, "N.cm": 1e-2},
}
"""By the SI unit of a dimension, the factors of others to it."""
COLUMNS = {"table": ("s", "N", "N", "N.m"), "target": ("s", "m", "m", "rad")}
"""The SI units of the columns of a hand's tables; those of a drive are the joint's."""


@dataclass(frozen=True, kw_only=True)
class RecordedTable:
    """A recorded log, in place of rows of time."""

    path: str
    """A CSV file, relative to the scene's file."""
    columns: tuple[str, ...] = ()
    """The names of its columns: time, then the values; "1", "2", ... where it names none. By
    default all."""
    units: tuple[str, ...] = ()
    """The unit of each column; by default SI."""


_KEYS = {field.name for field in fields(RecordedTable)}


def find_recorded_tables(
    data: Mapping[str, Any],
) -> Iterator[tuple[Keys, dict[str, Any], str]]:
    """The tables of hands, drives and signals of which `table` or `target` is a recorded log, each
    with its path in the scene and that key."""
    holders = tables_of_users(data, "hand")
    for i, joint in enumerate(entries(data, "linkage", "joint")):
        holders.append((("linkage", "joint", i, "drive"), value(joint, ("drive",))))
    holders += [((*path, key), table.get(key)) for path, table, key in signal_tables(data)]
    for path, holder in holders:
        for key in ("table", "target"):
            given = holder.get(key) if isinstance(holder, dict) else None
            if isinstance(given, dict) and "path" in given:
                yield path, holder, key


def signal_tables(
    data: Mapping[str, Any],
) -> Iterator[tuple[Keys, dict[str, Any], str]]:
    """The tables that may have the settings of the block `signal`, with their paths and the key of
    these."""
    for name, key in (("fmu", "settings"), ("connection", "from")):
        for i, entry in enumerate(entries(data, name)):
            if isinstance(entry, dict) and isinstance(entry.get(key), dict):
                yield (name, i), entry, key


def read_recorded_table(
    given: Mapping[str, Any], columns: Sequence[str] = (), start: float | None = None
) -> list[list[float]]:
    """The rows (time, values) in SI units, `columns` where they are known, from `start` on (s), or
    at the times that the file has; `true` is 1, `false` 0. Raises ValueError for unknown keys,
    columns and units, for a unit of another dimension, and for what is no finite number, with its
    line; InputFault for a file that cannot be read."""
    path, rows, places, _ = _read_rows(given)
    factors = _factors(given.get("units"), len(places), columns)
    each = [[_entry(path, *row, place, place != places[0]) for place in places] for row in rows]
    times = _seconds(rows, places[0], factors[0], start)
    return [
        [time, *(value * f for value, f in zip(values[1:], factors[1:], strict=True))]
        for time, values in zip(times, each, strict=True)
    ]


def read_recorded_texts(given: Mapping[str, Any]) -> list[list[Any]] | None:
    """The rows (time, texts), the times at which the file has them; None where its first row has
    numbers, which are not in quotes unless the time is, too. Raises as `read_recorded_table`
    does."""
    path, rows, places, quoted = _read_rows(given)
    in_quotes = places[0] not in quoted and quoted & {*places[1:]}
    fields = rows[0][1]
    first = [fields[p].strip().lower() for p in places[1:] if p < len(fields)]
    if not in_quotes and all(c in ("", "true", "false") or _number(c) is not None for c in first):
        return None
    for row in rows:
        _entry(path, *row, places[0], False)
    units = given.get("units") or ["s"]
    if units[1:] and any(units[1:]):
        raise ValueError(f"units = {units}: texts have none: give that of the time alone")
    times = _seconds(rows, places[0], _factors(units[:1], 1, ())[0], None)
    texts = ([fields[p] if p < len(fields) else "" for p in places[1:]] for _, fields in rows)
    return [[time, *row] for time, row in zip(times, texts, strict=True)]


def _read_rows(
    given: Mapping[str, Any],
) -> tuple[Path, list[tuple[int, list[str]]], list[int], set[int]]:
    """The file, its rows with their lines, the places of the columns that are asked for, and of
    those that have quotes in the first row."""
    if odd := given.keys() - _KEYS:
        raise ValueError(unknown("key of a recorded table", min(odd), _KEYS))
    path = Path(str(given["path"]))
    text = text_files.read_text(path, "a log", LARGEST)
    lines = list(csv.reader(text.splitlines(keepends=True)))
    names = [name.strip() for name in lines[0]] if lines else []
    headed = bool(names) and _number(names[0]) is None
    places = [*_places(given, names if headed else [str(i + 1) for i in range(len(names))])]
    rows = [
        (number, fields)
        for number, fields in enumerate(lines[headed:], 1 + headed)
        if any(field.strip() for field in fields)
    ]
    if not rows:
        raise ValueError(f"{path}: it has no rows")
    return path, rows, places, _find_quoted(text.splitlines()[rows[0][0] - 1])


def _find_quoted(line: str) -> set[int]:
    """The places of fields in quotes, if all others are numbers."""
    try:
        fields = next(csv.reader([line], quoting=csv.QUOTE_NONNUMERIC))
    except (ValueError, csv.Error):
        return set()
    return {i for i, field in enumerate(fields) if isinstance(field, str)}


def _seconds(
    rows: Sequence[tuple[int, list[str]]], place: int, factor: float, start: float | None
) -> Iterator[float]:
    # Decimals subtract and scale exactly: 9 ms are the number that 0.009 is.
    times, scale = [Decimal(fields[place].strip()) for _, fields in rows], repr(factor)
    begin = Decimal(0) if start is None else Decimal(repr(start)) - times[0] * Decimal(scale)
    return (float(time * Decimal(scale) + begin) for time in times)


def _places(given: Mapping[str, Any], names: Sequence[str]) -> Iterator[int]:
    """The places of the columns that are asked for, by default all."""
    for column in map(str, given.get("columns") or names):
        entries = takewhile(names.__contains__, (f"{column}[{i}]" for i in count(1)))
        found = [column] if column in names else [*entries]
        if not found:
            raise ValueError(unknown(f"column of {given['path']}", column, names))
        yield from map(names.index, found)


def _factors(units: Any, size: int, columns: Sequence[str]) -> list[float]:
    if not units:
        return [1.0] * size
    if len(units) != size:
        raise ValueError(f"{len(units)} units for {size} columns: give one for each")
    every = {unit: factor for of in UNITS.values() for unit, factor in of.items()}
    if not columns:  # a signal's values have any unit
        every |= dict.fromkeys(filter(_is_si, units[1:]), 1.0)
    for unit, si in zip_longest(units, (*columns, *("s",) * (not columns))):
        if unit is not None and unit not in every:
            raise ValueError(unknown("unit", unit, every))
        if unit is not None and si is not None and unit not in UNITS[si]:
            raise ValueError(f"{unit} where a column is in {si}: {', '.join(UNITS[si])}")
    return [every[unit] for unit in units]


def si_unit(unit: str) -> str:
    """The unit that values of a column have as they are read."""
    return next((si for si, of in UNITS.items() if unit in of), unit)


def _is_si(unit: str) -> bool:
    try:
        base_unit(unit)
    except InvalidUnit:
        return False
    return True


def _entry(path: Path, number: int, fields: Sequence[str], place: int, of_a_value: bool) -> float:
    field = fields[place] if place < len(fields) else ""
    if of_a_value and (truth := field.strip().lower()) in ("true", "false"):
        return float(truth == "true")
    if (value := _number(field)) is None or not math.isfinite(value):
        where = f"{path}: line {number}, column {place + 1}"
        finite = "" if value is None else "finite "
        raise ValueError(f"{where}: {field[:100]!r} is no {finite}number")
    return value


def _number(field: str) -> float | None:
    try:
        return float(field)
    except ValueError:
        return None
