"""Logs of a device whose times or numbers are not what a device gives, each fitted by the command:
other units, no growth, gaps, jumps, numbers that are none."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fuzz import mutations
from fuzz.cases import Made, seeded
from fuzz.commands import Place
from fuzz.processes import own_folder

COLUMNS = ("time", *(f"{n}[{i}]" for n in ("haptic_device.x", "hand.F") for i in (1, 2, 3)))
PERIODS = (0.0, 1e-300, 5e-324, 2e-9, 2e-6, 2e-3, 0.05, 2.0, 2e3, 2e6, 1e300)
KINDS = ("period", "offset", "row", "number", "text")


def _written(path: Path, kind: str, draw: random.Random) -> None:
    random_state = np.random.default_rng(draw.randrange(2**32))
    count = draw.choice((0, 1, 2, 256, 257, 700))
    period = draw.choice(PERIODS) if kind == "period" else 2e-3
    rows = np.cumsum(random_state.normal(0.0, 1e-3, (count, len(COLUMNS))), axis=0)
    rows[:, 0] = np.arange(count) * period
    if kind == "offset":
        rows[:, 0] += draw.choice((1e3, 1e9, 1e16, 1e300, -1e9))
    elif kind == "row" and count:
        rows[draw.randrange(count)] = rows[draw.randrange(count)]
    elif kind == "number" and count:
        number = float(draw.choice([n for n in mutations.NUMBERS if abs(n) < 1e308 or n != n]))
        rows[draw.randrange(count), draw.randrange(len(COLUMNS))] = number
    np.savetxt(path, rows, delimiter=",", header=",".join(COLUMNS), comments="", fmt="%.17g")
    if kind == "text":
        path.write_text(mutations.lines(path.read_text(), draw), errors="replace")


def attack(number: int, seed: int) -> Iterator[Made]:
    """`number` logs, the kinds in turn."""
    with own_folder() as folder:
        place, log = Place(folder), folder / "log.csv"
        for i, case, draw in seeded(number, seed):
            kind = KINDS[i % len(KINDS)]
            _written(log, kind, draw)
            made = place.made(["fit", str(log), "--out", str(folder / "fit")])
            yield Made(kind, case, *made)
