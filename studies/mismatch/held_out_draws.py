"""What the advice is worth on draws that no choice has seen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product

import numpy as np

from studies.mismatch.design import CONTINUOUS, DIRECT, MOBILITY
from studies.mismatch.findings import Found, paragraph
from studies.mismatch.measure import stable
from studies.mismatch.method_choice import (
    NEAR,
    Cell,
    Cells,
    cells,
    margin,
    metric,
    relative,
    within,
)
from studies.mismatch.methods import BIAS, COLUMNS, KEPT_APART, NEAREST, Method

PLACES = {DIRECT: "the graphics rate", MOBILITY: "512 Hz"}


def worth(found: Found) -> str:
    """How near the advice comes to the best of all methods."""
    by_cell = _apart(found)

    def near(arrangement: str, methods: Callable[[Cell], Sequence[Method]]) -> str:
        every = [c for c in found.advice if c[0] == arrangement]
        return _share([_near(by_cell, c, methods(c)) for c in every])

    def taken(cell: Cell) -> list[Method]:
        return [found.advice[cell].best]

    return (
        "On linkages, hands and a rate that were [kept apart](../../docs/glossary.md#words), the "
        "first method of a row is within a tenth of the best of all methods in "
        f"{near(MOBILITY, taken)} with the mechanism at 512 Hz, and in {near(DIRECT, taken)} with "
        "the mechanism at the graphics rate. There "
        "the best of this method and those to try, too, is so in "
        f"{near(DIRECT, lambda cell: found.listed[cell])}."
    )


def section(found: Found) -> Iterator[str]:
    """What the advice is worth where it was not looked for."""
    yield "## Kept apart: another linkage, another hand, another rate"
    by_cell = _apart(found)
    lines, every, sound, kept, of = [], list(product(PLACES, BIAS)), 0, 0, 0
    for rate in (*COLUMNS, KEPT_APART):
        row = [rate]
        for arrangement, bias in every:
            cell = (arrangement, bias, rate)
            chosen = found.advice[cell]
            rows = by_cell[cell][chosen.best].values()
            good = sum(map(within, rows))
            if chosen.admitted:
                sound, kept = sound + sum(map(stable, rows)), kept + good
                of += len(rows)
            taken = _near(by_cell, cell, [chosen.best])
            listed = _near(by_cell, cell, found.listed[cell])
            row.append(
                f"{good} of {len(rows)}{'' if chosen.admitted else '*'}; "
                f"{sum(taken)}, {sum(listed)} of {len(listed)}"
            )
        lines.append("| " + " | ".join(row) + " |")
    bad = _unstable_maps(found)
    yield paragraph(
        "The slider-crank, a massless spring hand of 200 N/m, and the rate of "
        f"{KEPT_APART} Hz, whose frames end between ticks (it takes the row of {NEAREST} Hz), "
        f"had no part in the choice. With the advised methods {sound} of {of} of these runs are "
        f"stable, and {kept} of {of} keep both limits. At rest on the slider-crank "
        f"{bad[0]} of the {bad[1]} rows with a map are unstable. A cell of the table has two "
        "parts. First: the draws within the limits with the method of the row (* not advised). "
        "Second, of the cases in which any method keeps the limits: how many have an error within "
        "a tenth of the smallest, with the row's method alone, and with the best of it and those "
        "to try, too (at 512 Hz all methods). The error is the tracking error, or at 512 Hz the "
        "coupling error ([kept-apart.csv](kept-apart.csv))."
    )
    heads = [f"{PLACES[a]}, {'on' if b == 'full' else 'off'}" for a, b in every]
    table = ["| Hz | " + " | ".join(heads) + " |", "|---" * (1 + len(heads)) + "|", *lines]
    yield "\n".join(table)
    looked_up = [_near(by_cell, c, [_nearest(by_cell, c)]) for c in found.advice if c[0] == DIRECT]
    yield paragraph(
        "With the mechanism at the graphics rate no one method can reach that for all hands: even "
        "the method that is within a tenth most often at a rate, looked up on these very cases, is "
        f"so in {_share(looked_up)}. `hapticlink advise` runs all methods on a scene of yours.",
    )


def _apart(found: Found) -> Cells:
    return cells(r for r in found.tried if r["arrangement"] != CONTINUOUS)


def _near(by_cell: Cells, cell: Cell, methods: Sequence[Method]) -> list[bool]:
    """By case in which any method keeps the limits: whether the best of some does, and is within a
    tenth of the best of all."""
    off = relative(by_cell[cell], metric(cell[0]))
    least: list[float] = np.min([off[m] for m in methods], axis=0).tolist()
    return [value <= NEAR for value in least]


def _nearest(by_cell: Cells, cell: Cell) -> Method:
    """The method that is within a tenth of the best in most cases, by the cases themselves."""
    return max(by_cell[cell], key=lambda m: sum(_near(by_cell, cell, [m])))


def _share(found: Sequence[Sequence[bool]]) -> str:
    every = [value for one in found for value in one]
    return f"{sum(every)} of {len(every)} cases ({np.mean(every):.0%})"


def _unstable_maps(found: Found) -> tuple[int, int]:
    """Of how many rows the map on linkages kept apart is unstable, and how many have one."""
    known = [
        least
        for (arrangement, _, rate), c in found.advice.items()
        if (least := margin(found.margins_apart, arrangement, c.best, rate)) is not None
    ]
    return sum(value < 0 for value in known), len(known)
