"""Rows of the study as a grid, hold by rate."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from hapticlink.orchestrator.study.cases import RATES, VARIABLE
from hapticlink.orchestrator.sweep.row import Row

COLUMNS = (*RATES, VARIABLE)


@dataclass(frozen=True)
class Cell:
    """A metric where all runs of a cell last, the largest of its seeds; otherwise the earliest
    end (s)."""

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
    if any(row["end"] != "duration" or metric not in row for row in group):
        return Cell(None, end)
    return Cell(max(row[metric] for row in group), end)


def best(found: Grid, rate: str) -> str | None:
    """The hold of the least metric at a rate, None where none lasts."""
    lasting = {h: v for h, by in found.items() if (v := by[rate].value) is not None}
    return min(lasting, key=lasting.__getitem__, default=None)


def lasting(found: Grid, hold: str) -> list[str]:
    """The rates at which a hold lasts."""
    return [rate for rate in COLUMNS if found[hold][rate].value is not None]


def short(value: float | None) -> str:
    """Two digits, never as a power; nothing for what is not there."""
    if value is None or value != value:
        return ""
    return f"{float(f'{value:.2g}'):.10g}"
