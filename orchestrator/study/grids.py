"""Rows of the study as a grid, hold by rate."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from hapticlink.orchestrator.study.cases import RATES, VARIABLE
from hapticlink.orchestrator.sweep.row import METRIC, Row

COLUMNS = (*RATES, VARIABLE)
COUPLING, MODELLING, ENERGY = "coupling_1s_mm", "modelling_1s_mm", "held_energy_made_J"
APART = 42.0, 1.0
"""mm, the length of a link, and rad: what is further apart is not one hand."""


@dataclass(frozen=True)
class Cell:
    """A metric where all runs of a cell last, the largest of its seeds; otherwise the earliest
    end (s), that of the whole run where handle and operational point came apart."""

    value: float | None
    end: float


Grid = Mapping[str, Mapping[str, Cell]]
"""By hold and rate."""


def grid(rows: Iterable[Row], metric: str, **where: str) -> Grid:
    """`metric` of the rows whose parts are those of `where`."""
    groups: dict[str, dict[str, list[Row]]] = {}
    for row in rows:
        if all(row.get(k) == v for k, v in where.items()):
            groups.setdefault(row["hold"], {}).setdefault(row["rate"], []).append(row)
    return {h: {r: _cell(g, metric) for r, g in by.items()} for h, by in groups.items()}


def _cell(group: list[Row], metric: str) -> Cell:
    end = min(row.get("end_time_s", 0.0) for row in group)
    if not all(_lasts(row) and metric in row for row in group):
        return Cell(None, end)
    return Cell(max(row[metric] for row in group), end)


def _lasts(row: Row) -> bool:
    """Whether a run comes to its end with handle and operational point less than APART."""
    whole = row["end"] == "duration"
    return whole and row[METRIC] < APART[0] and row["theta_max_rad"] < APART[1]


def best(found: Grid, rate: str) -> str | None:
    """The hold of the least metric at a rate, None where none stays stable."""
    lasting = {h: v for h, by in found.items() if (v := by[rate].value) is not None}
    return min(lasting, key=lasting.__getitem__, default=None)


def lasting(found: Grid, hold: str) -> list[str]:
    """The rates at which the run with a hold stays stable."""
    return [rate for rate in COLUMNS if found[hold][rate].value is not None]


def short(value: float | None) -> str:
    """Two digits, never as a power; nothing for what is not there."""
    if value is None or value != value:
        return ""
    return f"{float(f'{value:.2g}'):.10g}"


def median(values: Sequence[float | None]) -> float:
    """The upper one of two; NaN of nothing."""
    found = sorted(v for v in values if v is not None)
    return found[len(found) // 2] if found else float("nan")


def scaled(found: Grid, factor: float) -> Grid:
    return {
        h: {
            r: replace(c, value=None if c.value is None else factor * c.value)
            for r, c in by.items()
        }
        for h, by in found.items()
    }
