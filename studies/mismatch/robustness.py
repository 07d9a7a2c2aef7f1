"""How far the rows depend on which draws there were: each is chosen again by half of the draws of
each case, and draws of a case are asked whether they fail together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import exp
from typing import NamedTuple

import numpy as np

from hapticlink.analysis.sweep.row import Row
from studies.mismatch.cases import SEEDS
from studies.mismatch.design import DIRECT, MOBILITY
from studies.mismatch.findings import Found, paragraph
from studies.mismatch.method_choice import LEVEL, choice, logs, metric, within
from studies.mismatch.methods import COLUMNS, Method

Rows = Mapping[Method, Mapping[str, Row]]
ROBUST = 0.9
"""Share of the rows in which both halves have to agree lest the first method be one of several."""
FEW_FAIL = 0.2
"""Share of draws up to which a method counts as one that seldom fails."""


def halves(rows: Rows) -> tuple[Rows, Rows]:
    """The rows of the first draw of each case, and of the others."""
    first: dict[str, int] = {}
    for row in next(iter(rows.values())).values():
        seed = int(row["seed"])
        first[row["case"]] = min(seed, first.get(row["case"], seed))

    def half(is_first: bool) -> Rows:
        return {
            method: {
                d: r for d, r in by.items() if (int(r["seed"]) == first[r["case"]]) is is_first
            }
            for method, by in rows.items()
        }

    return half(True), half(False)


class Agreement(NamedTuple):
    """Of `rows` in which both halves advise a method, those in which it is the same one, and those
    in which its gains are; price: by which factor the error with the method of one half exceeds
    that with the other's own, at most: the largest of the medians over the draws."""

    rows: int
    same: int
    gains: int
    price: float

    @property
    def robust(self) -> bool:
        return self.same >= ROBUST * self.rows


def agreement(found: Found, arrangement: str) -> Agreement:
    """Of the rows with the mechanism at a rate."""
    rows = same = gains = 0
    price = 1.0
    for cell, by_method in found.cells.items():
        if cell[0] != arrangement or cell[2] not in COLUMNS:
            continue
        parts = halves(by_method)
        one, other = (choice(cell, part, found.margins) for part in parts)
        if not (one.admitted and other.admitted):
            continue
        rows += 1
        same += one.best == other.best
        gains += one.best.gains == other.best.gains
        for taken, own, part in ((one, other, parts[1]), (other, one, parts[0])):
            of = metric(arrangement)
            ratio = logs(part[taken.best], of) - logs(part[own.best], of)
            price = max(price, exp(float(np.median(ratio))))
    return Agreement(rows, same, gains, price)


def failures(found: Found) -> tuple[float, float]:
    """Of methods that seldom fail, the share of failing draws whose case fails in another draw,
    too, and what it would be if draws were independent."""
    together: list[bool] = []
    alone: list[float] = []
    for rows in found.cells.values():
        for method, by in rows.items():
            bad = [r["case"] for r in by.values() if not within(r)]
            if method.candidate and 0 < len(bad) <= FEW_FAIL * len(by):
                together += [bad.count(case) > 1 for case in bad]
                alone += [(len(bad) - 1) / (len(by) - 1)] * len(bad)
    if not together:
        return float("nan"), float("nan")
    return float(np.mean(together)), float(np.mean(alone))


def section(found: Found) -> Iterator[str]:
    """What of a row is robust."""
    yield "## How sure is a row"
    said = []
    for arrangement, place in ((DIRECT, "the graphics rate"), (MOBILITY, "512 Hz")):
        a = agreement(found, arrangement)
        first = "robust" if a.robust else "not robust: take its gains, and any of these holds"
        said.append(
            f"With the mechanism at {place} both advise something in {a.rows} rows, the same "
            f"method in {a.same} of them and the same gains in {a.gains}; the other's method costs "
            f"up to {a.price - 1:.0%} of error. Which method stands first in a row is {first}."
        )
    yield paragraph(
        "Methods were chosen again by half of the draws, one of each case, and by the other half. "
        f"{' '.join(said)} {sure_share(found)}"
    )


def sure_share(found: Found) -> str:
    """What is known of further draws where all keep the limits."""
    of = next(iter(found.advice.values())).of
    count = of // SEEDS
    sure = f"{1 - LEVEL:.0%} confidence"
    together, alone = failures(found)
    text = (
        f"Where all {of} draws keep the limits, up to {1 - LEVEL ** (1 / count):.0%} of further "
        f"ones may not ({sure}; the {count} cases are counted, not their draws)."
    )
    if np.isfinite(together):
        text += (
            f" Draws of a case fail together: of methods that fail in at most {FEW_FAIL:.0%} of "
            f"the draws, the other draw of a case that fails does so in {together:.0%}, where it "
            f"would be {alone:.0%} if draws were independent."
        )
    return text


def by_gains(methods: Sequence[Method]) -> str:
    """Methods by name, by their gains, in the order of the first of each: `soft: `zoh`, `foh``."""
    groups: dict[str, list[str]] = {}
    for method in methods:
        groups.setdefault(method.gains, []).append(f"`{method.hold}`")
    return "; ".join(f"{gains}: {', '.join(holds)}" for gains, holds in groups.items())
