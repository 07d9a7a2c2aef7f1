"""The study of mismatched rates: which hold, with which gains, at which graphics rate."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path

from hapticlink.analysis.sweep import table
from hapticlink.analysis.sweep.job import Job
from hapticlink.analysis.sweep.row import Row
from hapticlink.analysis.sweep.run_sweep import Means, Measure, Tell, sweep
from hapticlink.orchestrator.results import folders
from studies.mismatch import cases, design, measure, method_choice, page
from studies.mismatch.cases import Case
from studies.mismatch.methods import BIAS, KEPT_APART, NEAREST, VARIABLE

SECONDS = {"run": 0.07, "map": 0.8}
"""Processor time of a run, and of a scene at rest."""


def expected(processes: int) -> float:
    """Minutes that the whole study takes about."""
    known, apart = cases.trained(), cases.kept_apart()
    runs = design.count(len(known)) + design.count(len(apart), apart=True)
    linkages = len({case.linkage for case in known})
    maps = linkages * len(design.all_margins())
    return (SECONDS["run"] * runs + SECONDS["map"] * maps) / processes / 60


def study(
    folder: Path,
    room: Path,
    processes: int,
    tell: Tell | None = None,
    trained: Sequence[Case] | None = None,
    kept_apart: Sequence[Case] | None = None,
) -> Path:
    """Run what has no row in `room` yet, and write tables, figures and README.md to `folder`.

    trained: the draws by which methods are chosen; kept_apart: those on which the advice is tried;
    by default all. `tell` is called with the numbers of finished and of all jobs of a stage.
    Raises as `sweep` does.
    """
    folders.ensure(folder)
    known, apart = trained or cases.trained(), kept_apart or cases.kept_apart()

    def all_of(jobs: Sequence[Job], by: Measure) -> list[Row]:
        return sweep(jobs, Means(room, processes, tell), by)

    runs = measure.compared(all_of(design.runs(known), measure.of_run))
    linkages = dict.fromkeys(case.linkage for case in known)
    rest = all_of(design.margins(linkages, design.all_margins()), measure.at_rest)
    at = method_choice.margins(rest)
    by_cell = method_choice.cells(r for r in runs if r["arrangement"] != design.CONTINUOUS)
    advice = {cell: method_choice.choice(cell, rows, at) for cell, rows in by_cell.items()}
    listed = {cell: method_choice.to_try(cell, by_cell[cell], c.best) for cell, c in advice.items()}
    for arrangement, bias in product((design.DIRECT, design.MOBILITY), BIAS):
        row = arrangement, bias, NEAREST
        advice[arrangement, bias, KEPT_APART] = advice[row]
        listed[arrangement, bias, KEPT_APART] = listed[row]
    tried = measure.compared(all_of(design.runs(apart, apart=True), measure.of_run))
    new = [x for x in dict.fromkeys(case.linkage for case in apart) if x not in linkages]
    wanted = dict.fromkeys(
        (a, design.of_map(a, c.best), r)
        for (a, _, r), c in advice.items()
        if r != VARIABLE and design.mapped(c.best)
    )
    rest_apart = all_of(design.margins(new, wanted), measure.at_rest)
    found = page.Found(runs, by_cell, at, advice, listed, tried, method_choice.margins(rest_apart))
    named = {"runs": runs, "maps": rest, "kept-apart": [*tried, *rest_apart]}
    for name, rows in (named | {"advice": list(page.table_rows(found))}).items():
        table.write(folder / f"{name}.csv", [measure.rounded(row) for row in rows])
    return page.write(folder, found)
