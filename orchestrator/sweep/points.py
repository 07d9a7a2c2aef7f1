"""The runs of a sweep, as Python or the command line says them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hapticlink.orchestrator.base.faults import InputFault
from hapticlink.orchestrator.scene.overrides import text
from hapticlink.orchestrator.sweep.grid import Axis, Point, grid, listed, parse

Vary = Mapping[str, Iterable[Any]] | Sequence[str]
"""The values of each key; as text, what `--vary` takes."""
Runs = str | Path | Sequence[Mapping[str, Any]]
"""The options of each run, or the file that `--runs` takes."""


def points(vary: Vary, runs: Runs) -> list[Point]:
    """Every combination of `vary`, or `runs`. Raises InputFault, where both are given too."""
    if bool(vary) == bool(runs):
        raise InputFault("sweep: give either --vary key=values (repeatable) or --runs FILE")
    if isinstance(vary, Mapping):
        axes = [_axis(key, values) for key, values in vary.items()]
    else:
        axes = [parse(each) for each in vary]
    if axes:
        return grid(axes)
    if isinstance(runs, str | Path):
        return listed(Path(runs))
    return [{key: text(value, key) for key, value in run.items()} for run in runs]


def _axis(key: str, values: Iterable[Any]) -> Axis:
    if isinstance(values, str):
        return parse(f"{key}={values}")
    try:
        found = tuple(dict.fromkeys(text(value, key) for value in values))
    except TypeError:
        raise InputFault(f"{key}: {values!r} is one value; give a list of them") from None
    if not found:
        raise InputFault(f"{key}: no value; give some, e.g. [1, 2, 3]")
    return Axis(key, found)
