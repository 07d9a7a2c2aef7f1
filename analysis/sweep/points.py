"""The points of a sweep, given in Python or on the command line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hapticlink.analysis.sweep.grid import Axis, Point, grid, listed, parse
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.scene.overrides import text

Vary = Mapping[str, Iterable[Any]] | Sequence[str]
"""The values of each key, or texts as `--vary` takes them."""
Runs = str | Path | Sequence[Mapping[str, Any]]
"""The options of each run, or a file as `--runs` takes it."""


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
