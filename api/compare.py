"""Compares runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hapticlink.analysis.findings import summary
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.results.folders import names
from hapticlink.orchestrator.results.read_results import Results, load
from hapticlink.visualization.compare import numbers, overlay, page, settings
from hapticlink.visualization.compare.numbers import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SETTINGS = "Settings that differ"
LONGEST_NAME = 40
"""Characters of a name that is made of settings."""
AnyRun = Results | Path | str


@dataclass(frozen=True, repr=False, eq=False)
class Comparison:
    """Runs beside each other, by name. `print` gives the lines of `hapticlink compare`; a notebook
    shows a figure and a table."""

    runs: dict[str, Results]

    @property
    def tables(self) -> dict[str, list[Row]]:
        """Rows `(label, values)` with a value of each run, by title: settings that differ, outcome,
        performance, energies, stability, timing."""
        every = list(self.runs.values())
        rows = [Row(key, values) for key, values in settings.differing(every).items()]
        return {SETTINGS: rows, **numbers.sections(every)}

    @property
    def note(self) -> str:
        """Lines on which runs failed, and where the runs are of different scenes or mechanisms, or
        recorded the same rows; "" where there is none of it."""
        failed = [f"{n} {summary.ending(run)}" for n, run in self.runs.items() if run.record.fault]
        said = []
        if failed:
            said.append(f"{len(failed)} of {len(self.runs)} runs failed: {', '.join(failed)}")
        first, *others = self.runs.values()
        if other_scenes := settings.other_scenes([first, *others]):
            said.append(f"warning: {other_scenes}")
        elif all(run.has_rows_of(first) for run in others):
            said.append("the runs recorded the same numbers in every row")
        return "\n".join(said)

    def values(self) -> dict[str, dict[str, dict[str, str]]]:
        """The values of each run by its name, by title and by label."""
        tables = self.tables
        return {
            name: {
                title: {row.label: row.values[i] for row in rows} for title, rows in tables.items()
            }
            for i, name in enumerate(self.runs)
        }

    def figures(self) -> dict[str, Figure]:
        """Matplotlib figures by name, the runs over each other, as far as they have the signals:
        `distance`, `forces`, `user_port`, `constraints`, `paths`."""
        return overlay.figures(self.runs)

    def __str__(self) -> str:
        note = [self.note] if self.note else []
        return "\n".join([*note, *numbers.as_text(list(self.runs), self.tables)])

    def __repr__(self) -> str:
        return f"comparison of {', '.join(self.runs)}"

    def _repr_html_(self) -> str:
        rows = [
            row
            for title, rows in self.tables.items()
            if title == SETTINGS or title.startswith(numbers.PERFORMANCE)
            for row in rows
            if len({*row.values}) > 1
        ]
        return page.opening(self.runs, "h3") + page.table(list(self.runs), rows)


def compare(
    runs: Mapping[str, AnyRun] | Iterable[AnyRun],
) -> Comparison:
    """Compare two runs or more: settings that differ, how they ended, errors, forces, energies and
    timing.

    `runs` are results of `run` or `load`, or folders, by names that tell them apart; without names
    these are the folders', or the settings in which runs in memory differ. Raises InputFault for
    fewer than two runs, and as `load`.
    """
    given = runs if isinstance(runs, Mapping) else dict(enumerate(runs))
    if len(given) < 2:
        raise InputFault("compare takes two runs or more; `print(run)` says how one ended")
    found = {n: r if isinstance(r, Results) else load(r) for n, r in given.items()}
    if isinstance(runs, Mapping):
        return Comparison({str(name): run for name, run in found.items()})
    every = list(found.values())
    folders = [run.folder for run in every if run.folder]
    if len(folders) == len(every):
        return Comparison(dict(zip(names(folders), every, strict=True)))
    return Comparison(dict(zip(_by_settings(every), every, strict=True)))


def _by_settings(runs: list[Results]) -> list[str]:
    """Names of runs by the settings in which they differ, counted where that is too long."""
    differing = settings.differing(runs)
    names = [
        ", ".join(f"{key.rpartition('.')[2]} {values[i]}" for key, values in differing.items())
        for i in range(len(runs))
    ]
    fit = all(name and len(name) <= LONGEST_NAME for name in names) and len({*names}) == len(names)
    return names if fit else [f"run {i}" for i in range(1, len(runs) + 1)]
