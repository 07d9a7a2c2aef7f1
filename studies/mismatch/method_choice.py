"""The choice of a method in each cell of rate and model, by comparisons within draws.

A method is admitted to a cell if every draw ends within its limits: stable, and with a peak of the
energy generated at the user's port of at most SHARE of the hand's work (less than NOTICEABLE_J is
not counted). Where a lifted map vouches for it, that one must be stable on every linkage, too.

Of the admitted methods the one with the smallest median of log(error/mean of the draw) is advised.
Those that it does not beat beyond the spread, by a smaller error in more than three quarters of the
draws, are as good.

Where none is admitted nothing is advised. Then the best one keeps the limits in the most draws, and
beats another beyond the spread if a sign test says so at LEVEL: of the n draws in which one of the
two alone keeps them it has at least k, where P(at least k heads of n tosses) < LEVEL.

No method has nearly the smallest error in every case. So a cell has a list to try, too: LISTED
methods, the one above first, each next one that with which the smallest error of the list is within
NEAR of that of all methods in the most cases.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings.user_port import NOTICEABLE_J, SHARE
from hapticlink.analysis.sweep.row import METRIC, Row
from studies.mismatch.design import MOBILITY, of_map
from studies.mismatch.measure import COUPLING, MARGIN, PEAK, WORK, draw, stable
from studies.mismatch.methods import Method, order

LEVEL = 0.05
NEAR, LISTED = 1.1, 5
Cell = tuple[str, str, str]
"""Arrangement, bias and rate."""
Listed = tuple[Method, ...]
Cells = Mapping[Cell, Mapping[Method, Mapping[str, Row]]]
"""The rows by cell, method and draw."""
Margins = Mapping[tuple[str, Method, str], Mapping[str, Row]]
"""The rows at rest by (arrangement, method, rate) and linkage."""


def method(row: Row) -> Method:
    return Method(row["hold"], row["gains"], row["integrator"])


def cells(rows: Iterable[Row]) -> Cells:
    found: dict[Cell, dict[Method, dict[str, Row]]] = {}
    for row in rows:
        by_method = found.setdefault((row["arrangement"], row["bias"], row["rate"]), {})
        by_method.setdefault(method(row), {})[draw(row)] = row
    return found


def margins(rows: Iterable[Row]) -> Margins:
    found: dict[tuple[str, Method, str], dict[str, Row]] = {}
    for row in rows:
        at = found.setdefault((row["arrangement"], method(row), row["rate"]), {})
        at[row["linkage"]] = row
    return found


def energy(row: Row, share: float = SHARE) -> float:
    """The peak of the energy generated at the user's port, relative to what is allowed."""
    return max(0.0, float(row[PEAK])) / max(NOTICEABLE_J, share * row[WORK])


def within(row: Row, share: float = SHARE) -> bool:
    """Whether a run keeps both limits."""
    return stable(row) and energy(row, share) <= 1.0


def margin(at: Margins, arrangement: str, of: Method, rate: str) -> float | None:
    """The smallest margin (1/s) over the linkages; None without maps."""
    rows = at.get((arrangement, of_map(arrangement, of), rate), {}).values()
    known = [row[MARGIN] for row in rows if MARGIN in row]
    return min(known) if known else None


def metric(arrangement: str) -> str:
    """What methods are compared by: a mechanism at 512 Hz is tracked in any case, and what the
    user feels of held mobility is the coupling error."""
    return COUPLING if arrangement == MOBILITY else METRIC


@dataclass(frozen=True)
class Choice:
    """The advice for a cell. best: that of the smallest error, or, where none is admitted, which
    keeps the limits in the most draws; ties: all others that it does not beat, from the simplest
    on. `most` of the `of` draws stay within the limits with `best`, and `lost` are unstable."""

    cell: Cell
    best: Method
    ties: tuple[Method, ...]
    most: int
    of: int
    lost: int
    admitted: bool

    @property
    def method(self) -> Method | None:
        """What is advised, if anything is."""
        return self.best if self.admitted else None


def choice(
    cell: Cell,
    by_method: Mapping[Method, Mapping[str, Row]],
    at: Margins,
    share: float = SHARE,
) -> Choice:
    """The advice for a cell, with `share` as the limit of energy."""
    arrangement, _, rate = cell
    simple = sorted((m for m in by_method if m.candidate), key=order)
    draws = sorted(by_method[simple[0]])
    kept = {m: np.array([within(by_method[m][d], share) for d in draws]) for m in simple}
    least = {m: margin(at, arrangement, m, rate) for m in simple}
    sound = [m for m in simple if (known := least[m]) is None or known > 0]
    able = [m for m in sound if kept[m].all()]
    if not able:
        best = max(sound or simple, key=lambda m: int(kept[m].sum()))
        ties = tuple(m for m in sound if m != best and not more(kept[best], kept[m]))
        lost = sum(not stable(row) for row in by_method[best].values())
        return Choice(cell, best, ties, int(kept[best].sum()), len(draws), lost, False)
    errors = {m: logs(by_method[m], metric(arrangement)) for m in able}
    mean = np.mean(list(errors.values()), axis=0)
    best = min(able, key=lambda m: float(np.median(errors[m] - mean)))
    even = (m for m in able if np.quantile(errors[m] - errors[best], 0.25) <= 0.0)
    ties = tuple(m for m in even if m != best)
    return Choice(cell, best, ties, len(draws), len(draws), 0, True)


def to_try(cell: Cell, by_method: Mapping[Method, Mapping[str, Row]], first: Method) -> Listed:
    """The list of a cell, from `first` on, in the order of what each adds."""
    tried = {m: rows for m, rows in by_method.items() if m.candidate}
    off, listed = relative(tried, metric(cell[0])), [first]
    while len(listed) < min(LISTED, len(tried)):

        def gain(m: Method) -> tuple[int, float]:
            least = np.min([off[one] for one in (*listed, m)], axis=0)
            return int((least <= NEAR).sum()), -float(np.minimum(np.log(least), 3.0).sum())

        listed.append(max((m for m in tried if m not in listed), key=gain))
    return tuple(listed)


def relative(by_method: Mapping[Method, Mapping[str, Row]], of: str) -> dict[Method, list[float]]:
    """By case, the error of each method (geometric mean of the case's draws) relative to the
    smallest of the methods that keep the limits in all draws of the case; infinite where it keeps
    them not itself. Cases in which none does are left out."""
    names = sorted({row["case"] for row in next(iter(by_method.values())).values()})
    size = {}
    for m, rows in by_method.items():
        mine = [[row for row in rows.values() if row["case"] == name] for name in names]
        size[m] = np.array(
            [
                np.exp(np.mean([np.log(max(r[of], 1e-9)) for r in each]))
                if all(map(within, each))
                else np.inf
                for each in mine
            ]
        )
    least = np.min(list(size.values()), axis=0)
    some = np.isfinite(least)
    return {m: (found[some] / least[some]).tolist() for m, found in size.items()}


def more(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> bool:
    """Whether `one` holds in more draws than `other` beyond the spread, by the sign test."""
    k, n = int((one & ~other).sum()), int((one ^ other).sum())
    return sum(comb(n, i) for i in range(k, n + 1)) < LEVEL * 2**n


def logs(rows: Mapping[str, Row], of: str) -> np.ndarray:
    """ln(error) by draw, in the order of the draws' names."""
    found: np.ndarray = np.log([max(rows[name][of], 1e-9) for name in sorted(rows)])
    return found


def quartiles(rows: Iterable[Row], of: str) -> Sequence[float]:
    """Lower quartile, median, upper quartile and largest value."""
    values = [row[of] for row in rows if of in row] or [np.nan]
    found: Sequence[float] = np.quantile(values, [0.25, 0.5, 0.75, 1.0]).tolist()
    return found


def over_seeds(rows: Iterable[Row], of: str) -> float:
    """The largest by the smallest value of the draws of a case, median of the cases."""
    by_case: dict[str, list[float]] = {}
    for row in rows:
        by_case.setdefault(row["case"], []).append(max(row[of], 1e-9))
    ratios = [max(found) / min(found) for found in by_case.values() if len(found) > 1]
    return float(np.median(ratios)) if ratios else float("nan")
