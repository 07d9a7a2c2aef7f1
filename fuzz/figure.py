"""Draws results/faults/ends.png, how the cases of every attack ended, from their tables:

python -m fuzz.figure
"""

from __future__ import annotations

import csv

from matplotlib.figure import Figure

from fuzz.__main__ import ATTACKS
from fuzz.cases import FOLDER

ENDS = {
    "done": "#0077bb",
    "returned": "#44aa99",
    "refused": "#88bbdd",
    "told": "#ddaa33",
    "before": "0.7",
}
BAD = {"lost": "#cc3311", "crashed": "#ee3377", "hung": "#aa3377", "believed": "#661100"}


def counts(name: str) -> dict[str, int]:
    """Cases of an attack by their end."""
    with (FOLDER / f"{name}.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    known = [*ENDS, *BAD]
    return {end: sum(int(row.get(end) or 0) for row in rows) for end in known}


def figure() -> Figure:
    drawn = Figure(figsize=(7.5, 5.0), layout="constrained")
    axes = drawn.add_subplot()
    found = {name: counts(name) for name in ATTACKS}
    left = dict.fromkeys(ATTACKS, 0.0)
    for end, color in (ENDS | BAD).items():
        shares = [100 * found[name][end] / sum(found[name].values()) for name in ATTACKS]
        axes.barh([*ATTACKS], shares, left=list(left.values()), color=color, label=end)
        left = {name: left[name] + share for name, share in zip(ATTACKS, shares, strict=True)}
    bad = sum(cases[end] for cases in found.values() for end in BAD)
    total = sum(sum(cases.values()) for cases in found.values())
    title = f"{bad} of {total:,} cases lost results, crashed, hung or were believed"
    axes.set_title(title, fontsize="medium")
    axes.set(xlabel="cases (%)", xlim=(0, 100))
    axes.invert_yaxis()
    drawn.legend(loc="outside right upper", fontsize="small")
    return drawn


if __name__ == "__main__":
    figure().savefig(FOLDER / "ends.png", dpi=110, metadata={"Software": None})
