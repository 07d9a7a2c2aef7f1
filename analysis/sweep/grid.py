"""The points of a sweep: a grid of axes, or a list of runs, in Python or as text.

A point is {dotted key: value as text}, as `--set` takes them.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, time
from decimal import Decimal, InvalidOperation
from itertools import product
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base import text_files
from hapticlink.orchestrator.base.errors import InputFault, shorten
from hapticlink.orchestrator.scene.overrides import text
from hapticlink.orchestrator.scene.toml_keys import flat, loads

Point = dict[str, str]
Vary = Mapping[str, Iterable[Any]] | Sequence[str]
"""The values of each key, or texts as `--vary` takes them."""
Runs = str | Path | Sequence[Mapping[str, Any]]
"""The options of each run, or a file as `--runs` takes it."""

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"({_NUMBER})\.\.({_NUMBER})(?:\.\.({_NUMBER})|:(\d+))?")
MAX_RUNS = 100_000
"""Of a sweep, and values of one of its axes; more are taken for a mistake."""
MAX_DIGITS = 15
"""Digits of the ends of a range on either side of the point: their differences are exact."""
MAX_LIST_BYTES = 2**24
"""Bytes of a list of runs."""


@dataclass(frozen=True)
class Axis:
    """A key and its values, as text."""

    key: str
    values: tuple[str, ...]

    @property
    def is_scale(self) -> bool:
        """Whether it has several values, all of them numbers."""
        return len(self.values) > 1 and all(number(value) is not None for value in self.values)


def points(vary: Vary, runs: Runs) -> list[Point]:
    """The points of every combination of `vary`, or of `runs`. Raises InputFault unless exactly one
    of them is given, and for values that cannot be read."""
    if bool(vary) == bool(runs):
        raise InputFault("sweep: give either --vary key=values (repeatable) or --runs FILE")
    if vary:
        return grid(axes(vary))
    if isinstance(runs, str | Path):
        return listed(Path(runs))
    if not all(isinstance(run, Mapping) for run in runs):
        raise InputFault("runs: give a mapping of keys to values for each run, or a file")
    return [{key: text(value, key) for key, value in run.items()} for run in runs]


def axes(vary: Vary) -> list[Axis]:
    """The axes of `vary`. Raises InputFault for values that cannot be read."""
    if isinstance(vary, str):
        raise InputFault(f"vary {vary!r}: give a mapping, or a list of key=values")
    if isinstance(vary, Mapping):
        return [_axis(key, values) for key, values in vary.items()]
    if not all(isinstance(values, str) for values in vary):
        raise InputFault("vary: give a mapping of keys to values, or a list of key=values")
    return [parse(values) for values in vary]


def _axis(key: str, values: Iterable[Any]) -> Axis:
    if isinstance(values, str):
        return parse(f"{key}={values}")
    try:
        texts = tuple(dict.fromkeys(text(value, key) for value in values))
    except TypeError:
        raise InputFault(f"{key}: {values!r} is one value; give a list of them") from None
    if not texts:
        raise InputFault(f"{key}: no value; give some, e.g. [1, 2, 3]")
    return Axis(key, texts)


def parse(option: str) -> Axis:
    """The axis of `key=values`, with values and ranges separated by commas.

    `a..b` is every whole number from a to b, `a..b..step` has this step, `a..b:n` has n evenly
    spaced points (to 6 digits). Raises InputFault if it cannot be read or is empty.
    """
    key, equals, values = option.partition("=")
    key = key.strip()
    if not equals or not key:
        raise InputFault(f"--vary {option}: write key=values, e.g. --vary graphics.rate=10..60..10")
    listed = [value for item in _items(values) for value in _values(item, shorten(option))]
    if not listed:
        raise InputFault(f"--vary {option}: no value; give some, e.g. {key}=1,2,3")
    return Axis(key, tuple(dict.fromkeys(listed)))


def grid(axes: Sequence[Axis]) -> list[Point]:
    """Every combination of the axes' values; the first axis varies slowest. Raises InputFault for a
    key that is given twice."""
    keys = [axis.key for axis in axes]
    twice = next((k for k in keys if keys.count(k) > 1), None)
    if twice:
        raise InputFault(f"--vary {twice}: given twice; write all its values with commas")
    if (count := math.prod(len(a.values) for a in axes)) > MAX_RUNS:
        raise InputFault(f"--vary: {count} runs; at most {MAX_RUNS} are made: take fewer values")
    return [dict(zip(keys, values, strict=True)) for values in product(*(a.values for a in axes))]


def listed(path: Path) -> list[Point]:
    """The runs of a file: a CSV with one column per key (an empty cell keeps the scene's value), or
    a TOML file of [[run]] tables. Raises InputFault if it cannot be read or has no run."""
    text = text_files.read_text(path, "a list of runs", MAX_LIST_BYTES, "utf-8-sig")
    try:
        points = list(_toml(path, text) if path.suffix == ".toml" else _csv(path, text))
    except csv.Error as error:
        raise InputFault(f"--runs {path}: not CSV: {error}") from error
    if len(points) > MAX_RUNS:
        raise InputFault(f"--runs {path}: {len(points)} runs; at most {MAX_RUNS} are made")
    if not points:
        form = "[[run]] table" if path.suffix == ".toml" else "row under its header"
        raise InputFault(f"--runs {path}: no runs; give one {form} a run")
    return points


def _items(text: str) -> Iterator[str]:
    """The parts of a text between commas that are outside of brackets and quotes."""
    depth, quote, start = 0, "", 0
    for i, letter in enumerate(text):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in "[{":
            depth += 1
        elif letter in "]}":
            depth -= 1
        elif letter == "," and not depth:
            yield text[start:i].strip()
            start = i + 1
    yield text[start:].strip()


def _values(item: str, option: str) -> Iterable[str]:
    match = _RANGE.fullmatch(item)
    if not match:
        return [item] if item else []
    first, last = Decimal(match[1]), Decimal(match[2])
    numbers = [first, last, Decimal(match[3] or 1)]
    if any(not n.is_zero() and not -MAX_DIGITS < n.adjusted() < MAX_DIGITS for n in numbers):
        raise InputFault(
            f"--vary {option}: {item} has numbers beyond 1e{MAX_DIGITS}; list the values"
        )
    if last < first:
        raise InputFault(f"--vary {option}: {item} ends below its start; write {last}..{first}")
    if match[4]:
        count = int(match[4][:9])
        if not 2 <= count <= MAX_RUNS:
            raise InputFault(f"--vary {option}: {item} has {match[4]} points; give 2 to {MAX_RUNS}")
        return [f"{first + (last - first) * i / (count - 1):.6g}" for i in range(count)]
    step = Decimal(match[3]) if match[3] else Decimal(1)
    if not match[3] and (first % 1 or last % 1):
        raise InputFault(
            f"--vary {option}: {item} is every whole number, but an end is none; write "
            f"{item}..STEP or {item}:POINTS"
        )
    if step <= 0 or (last - first) / step >= MAX_RUNS:
        raise InputFault(f"--vary {option}: {item} goes in steps of {step}; take a larger one")
    return [_plain(first + i * step) for i in range(int((last - first) / step) + 1)]


def _plain(number: Decimal) -> str:
    return f"{number.normalize():f}"


def _csv(path: Path, text: str) -> Iterator[Point]:
    reader = csv.DictReader(text.splitlines())
    for row in reader:
        if None in row or None in row.values():
            count = len(reader.fieldnames or ())
            raise InputFault(f"--runs {path}: line {reader.line_num}: not {count} cells")
        yield {key.strip(): cell.strip() for key, cell in row.items() if cell.strip()}


def _toml(path: Path, content: str) -> Iterator[Point]:
    try:
        runs = loads(content).get("run", [])
    except ValueError as error:
        raise InputFault(f"--runs {path}: not TOML: {error}") from error
    if not isinstance(runs, list) or not all(isinstance(run, dict) for run in runs):
        raise InputFault(f"--runs {path}: `run` is no array of tables; write [[run]]")
    for run in runs:
        yield {
            key: str(value) if isinstance(value, date | time) else text(value, key)
            for key, value in flat(run)
            if value != {}
        }


def number(text: str) -> float | None:
    """The number that a text writes, None if it is no number."""
    try:
        return float(Decimal(text))
    except InvalidOperation:
        return None
