"""`hapticlink advise` on scenes that it was not made with: is another method better?

Scenes are drawn with seeds: linkage, masses, gains, rates, delays, hand (fuzz/verdicts.py).
Each is advised. Then all holds with all gains run on DRAWS draws of it that `advise` has not seen.
The best is the one with the smallest error, median of log(error) over these draws, of those that
keep the limits in all of them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill

import numpy as np

from benchmarks.page import Progress, table
from fuzz.verdicts import drawn
from hapticlink.analysis.advise.advise_method import (
    Advice,
    advise,
    all_methods,
    on_draws,
)
from hapticlink.analysis.advise.draws import draws
from hapticlink.analysis.advise.method import Method
from hapticlink.analysis.sweep.row import METRIC, Row
from hapticlink.analysis.sweep.run_sweep import Means
from hapticlink.orchestrator import open_scene
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.scene import overrides

FIRST, COUNT = 2300, 10
"""Seeds of the scenes."""
DRAWS, SEED, NEAR = 8, 1, 1.1
"""Draws of a scene, their seed, which `advise` does not use, and how near the best is as good."""
WIDTH = 108


@dataclass(frozen=True)
class Judged:
    """The advice for a scene, and what it is worth on draws kept apart. best: None where no method
    keeps the limits in all of them; kept: by the number of draws; ratio: of the errors."""

    seed: int
    scene: str
    advice: Advice
    best: Method | None
    kept: int
    most: int
    ratio: float

    @property
    def within(self) -> bool:
        """Whether the advice keeps the limits wherever a method does, or says that it does not."""
        return self.kept == DRAWS or (self.best is None and not self.advice.taken.admitted)

    @property
    def near(self) -> bool:
        return self.ratio <= NEAR

    @property
    def row(self) -> tuple[object, ...]:
        """Of the table."""
        taken = self.advice.taken
        limits = f" (keeps the limits in {taken.within} of {len(taken.error_mm)})"
        note = "" if taken.admitted else limits
        best = self.best.name if self.best else f"none ({self.most} of {DRAWS} at most)"
        ratio = short(self.ratio) if self.best else "-"
        advised = f"{taken.method.name}{note}"
        return self.seed, self.scene, advised, f"{self.kept} of {DRAWS}", best, ratio


def judged(seed: int, folder: Path, processes: int) -> Judged:
    """The advice for the scene of a seed, judged."""
    name, changes = drawn(seed)
    options = overrides.write_options(changes | {"packaging": "native"})
    advice = advise(name, options, Means(folder / "advice", processes))
    read = open_scene.load(name, options)
    apart = list(draws(read, DRAWS, SEED))
    every = list(dict.fromkeys([*all_methods(read), advice.taken.method]))
    rows = on_draws(name, options, every, apart, Means(folder / "apart", processes))
    limits = advice.limits
    kept = {method: sum(not limits.why_not(row) for row in found) for method, found in rows.items()}
    able = [method for method in rows if kept[method] == DRAWS]
    best = min(able, key=lambda m: _error(rows[m])) if able else None
    taken = advice.taken.method
    ratio = _error(rows[taken]) / _error(rows[best]) if best else np.nan
    said = (
        f"`{name}`, {read.haptics.rate} Hz, {read.graphics.rate if read.graphics else '-'} Hz, "
        f"{'own' if 'hand' not in changes else 'constant'} hand"
    )
    return Judged(seed, said, advice, best, kept[taken], max(kept.values()), float(ratio))


def _error(rows: Sequence[Row]) -> float:
    return float(np.exp(np.median([np.log(max(row.get(METRIC, 1e3), 1e-9)) for row in rows])))


def page(found: Sequence[Judged], command: str) -> Iterator[str]:
    known = [one for one in found if one.best]
    yield "# What `hapticlink advise` is worth on test scenes\n"
    yield fill(
        f"The advised method is within a tenth of the best of all methods in "
        f"{sum(one.near for one in known)} of the {len(known)} scenes in which any keeps the "
        f"limits in all draws. The advice is right about the limits in "
        f"{sum(one.within for one in found)} of {len(found)}: its method keeps them, or it says "
        "that none does.",
        WIDTH,
    )
    yield ""
    yield fill(
        f"`{command}` makes this page. Scenes are drawn with the seed of the row "
        "(`fuzz/verdicts.py`): linkage, masses, gains, rates, delays, hand. `advise` runs "
        "on its own [draws](../../docs/glossary.md#words); then all holds with the "
        f"scene's own, soft and medium gains run on {DRAWS} others. Error: the largest distance of "
        "handle and operational point of a run, median of the draws.",
        WIDTH,
    )
    yield ""
    heads = "seed | scene | advised | within the limits | best | error relative to the best"
    yield from table(heads, "llllll", (one.row for one in found))


def bench(out: Path, quick: bool, progress: Progress, command: str) -> str:
    count = 2 if quick else COUNT
    found = []
    for i in range(count):
        progress(f"scene {i + 1}", i, count)
        found.append(judged(FIRST + i, Path("sweeps/advise"), os.cpu_count() or 1))
    return "\n".join(page(found, command)) + "\n"
