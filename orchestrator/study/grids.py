"""The rows of the study as grids of holds against rates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from hapticlink.orchestrator.study.cases import RATES, VARIABLE
from hapticlink.orchestrator.sweep.row import METRIC, Row

COLUMNS = (*RATES, VARIABLE)
COUPLING, MODELLING, ENERGY = "coupling_1s_mm", "modelling_1s_mm", "held_energy_peak_J"
APART = 42.0, 1.0
"""Tracking errors (mm, the length of a link, and rad) from which on a run counts as unstable."""


@dataclass(frozen=True)
class Cell:
    """A metric, the largest over the seeds of a cell; None if a run of them is unstable. end: the
    earliest end of these runs (s)."""

    value: float | None
    end: float


Grid = Mapping[str, Mapping[str, Cell]]
"""A cell for each hold and rate."""


def grid(rows: Iterable[Row], metric: str, **where: str) -> Grid:
    """The grid of `metric` for the rows that have the values `where` in these columns."""
    groups: dict[str, dict[str, list[Row]]] = {}
    for row in rows:
        if all(row.get(k) == v for k, v in where.items()):
            groups.setdefault(row["hold"], {}).setdefault(row["rate"], []).append(row)
    return {h: {r: _cell(g, metric) for r, g in by.items()} for h, by in groups.items()}


def _cell(group: list[Row], metric: str) -> Cell:
    end = min(row.get("end_time_s", 0.0) for row in group)
    if not all(_stable(row) and metric in row for row in group):
        return Cell(None, end)
    return Cell(max(row[metric] for row in group), end)


def _stable(row: Row) -> bool:
    """Whether a run reaches its end with tracking errors below APART."""
    whole = row["end"] == "duration"
    return whole and row[METRIC] < APART[0] and row["theta_max_rad"] < APART[1]


def best(found: Grid, rate: str) -> str | None:
    """The hold with the smallest metric at a rate; None if none stays stable."""
    stable = {h: v for h, by in found.items() if (v := by[rate].value) is not None}
    return min(stable, key=stable.__getitem__, default=None)


def stable_rates(found: Grid, hold: str) -> list[str]:
    """The rates at which the run with a hold stays stable."""
    return [rate for rate in COLUMNS if found[hold][rate].value is not None]


def short(value: float | None) -> str:
    """A number with two significant digits and no exponent; "" for None and NaN."""
    if value is None or value != value:
        return ""
    return f"{float(f'{value:.2g}'):.10g}"


def median(values: Sequence[float | None]) -> float:
    """The median, the upper one of an even number of values, without None; NaN if there is none."""
    found = sorted(v for v in values if v is not None)
    return found[len(found) // 2] if found else float("nan")


def scaled(found: Grid, factor: float) -> Grid:
    """The grid with its values multiplied by `factor`."""
    return {
        h: {
            r: replace(c, value=None if c.value is None else factor * c.value)
            for r, c in by.items()
        }
        for h, by in found.items()
    }
