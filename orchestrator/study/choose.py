"""The choice of a method in each cell of rate and model, by comparisons within cases.

A method is admitted to a cell if every case ends within its limits: stable, and with a peak of the
energy generated at the user's port of at most SHARE of the hand's work (less than LEAST is not
counted). Where a lifted map vouches for it, that one must be stable on every linkage, too.

Of two admitted methods one is better beyond the spread if its error is smaller in more than three
quarters of the cases. The best one has the smallest median of log(error/mean of the case); those
that it does not beat beyond the spread are ties, of which the simplest is advised.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hapticlink.orchestrator.study.design import MOBILITY
from hapticlink.orchestrator.study.measure import COUPLING, MARGIN, PEAK, WORK, stable
from hapticlink.orchestrator.study.methods import Method, order
from hapticlink.orchestrator.sweep.row import METRIC, Row

SHARE, LEAST = 0.25, 1e-3
"""Share of the hand's work, and energy (J): what moves the handle at 8 cm/s."""
Cell = tuple[str, str, str]
"""Arrangement, bias and rate."""
Cells = Mapping[Cell, Mapping[Method, Mapping[str, Row]]]
"""The rows by cell, method and case."""
Margins = Mapping[tuple[str, Method, str], Mapping[str, Row]]
"""The rows at rest by (arrangement, method, rate) and linkage."""


def method(row: Row) -> Method:
    return Method(row["hold"], row["gains"], row["integrator"])


def cells(rows: Iterable[Row]) -> Cells:
    found: dict[Cell, dict[Method, dict[str, Row]]] = {}
    for row in rows:
        by_method = found.setdefault((row["arrangement"], row["bias"], row["rate"]), {})
        by_method.setdefault(method(row), {})[row["case"]] = row
    return found


def margins(rows: Iterable[Row]) -> Margins:
    found: dict[tuple[str, Method, str], dict[str, Row]] = {}
    for row in rows:
        at = found.setdefault((row["arrangement"], method(row), row["rate"]), {})
        at[row["linkage"]] = row
    return found


def energy(row: Row, share: float = SHARE) -> float:
    """The peak of the energy generated at the user's port, relative to what is allowed."""
    return max(0.0, float(row[PEAK])) / max(LEAST, share * row[WORK])


def within(row: Row, share: float = SHARE) -> bool:
    """Whether a run keeps both limits."""
    return stable(row) and energy(row, share) <= 1.0


def margin(at: Margins, arrangement: str, of: Method, rate: str) -> float | None:
    """The smallest margin (1/s) over the linkages; None without maps."""
    rows = at.get((arrangement, of, rate), {}).values()
    known = [row[MARGIN] for row in rows if MARGIN in row]
    return min(known) if known else None


def metric(arrangement: str) -> str:
    """What methods are compared by: a mechanism at 512 Hz is tracked in any case, and what the
    user feels of held mobility is the coupling error."""
    return COUPLING if arrangement == MOBILITY else METRIC


@dataclass(frozen=True)
class Choice:
    """The advice for a cell. method: None if none is admitted; then `most` of the `of` cases stay
    within the limits with the method `nearest`. ties: all that the best does not beat."""

    cell: Cell
    method: Method | None
    best: Method | None
    ties: tuple[Method, ...]
    nearest: Method
    most: int
    of: int


def choice(
    cell: Cell,
    by_method: Mapping[Method, Mapping[str, Row]],
    at: Margins,
    share: float = SHARE,
) -> Choice:
    """The advice for a cell, with `share` as the limit of energy."""
    arrangement, _, rate = cell
    counts = {m: sum(within(r, share) for r in rows.values()) for m, rows in by_method.items()}
    of = max(len(rows) for rows in by_method.values())
    simple = sorted(by_method, key=order)
    nearest = max(simple, key=counts.__getitem__)
    able = [
        m
        for m in simple
        if counts[m] == of and ((least := margin(at, arrangement, m, rate)) is None or least > 0)
    ]
    if not able:
        return Choice(cell, None, None, (), nearest, counts[nearest], of)
    errors = {m: logs(by_method[m], metric(arrangement)) for m in able}
    mean = np.mean(list(errors.values()), axis=0)
    best = min(able, key=lambda m: float(np.median(errors[m] - mean)))
    ties = tuple(m for m in able if np.quantile(errors[m] - errors[best], 0.25) <= 0.0)
    return Choice(cell, ties[0], best, ties, nearest, of, of)


def logs(rows: Mapping[str, Row], of: str) -> np.ndarray:
    """ln(error) by case, in the order of the cases' names."""
    found: np.ndarray = np.log([max(rows[case][of], 1e-9) for case in sorted(rows)])
    return found


def quartiles(rows: Iterable[Row], of: str) -> Sequence[float]:
    """Lower quartile, median, upper quartile and largest value."""
    values = [row[of] for row in rows if of in row] or [np.nan]
    found: Sequence[float] = np.quantile(values, [0.25, 0.5, 0.75, 1.0]).tolist()
    return found
