"""Runs many variants of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.sweep import grid, job, repeats, row, table
from hapticlink.analysis.sweep.grid import Runs, Vary, points
from hapticlink.analysis.sweep.run_sweep import Means, Unfinished
from hapticlink.analysis.sweep.run_sweep import sweep as make
from hapticlink.api.result import frame
from hapticlink.orchestrator.base import temporary_folders
from hapticlink.orchestrator.base.errors import Fault, InputFault, unknown
from hapticlink.orchestrator.base.process import count_processes
from hapticlink.orchestrator.results import folders
from hapticlink.orchestrator.results.html_table import html_table
from hapticlink.orchestrator.scene import overrides
from hapticlink.orchestrator.scene.overrides import Options
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.visualization import figure_files
from hapticlink.visualization.figures import sweep_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


SPREAD = "spread.csv"


@dataclass(frozen=True, repr=False, eq=False)
class Sweep:
    """The table of a sweep: `s["tracking_max_mm"]` is a column as a NumPy array, one entry per run,
    of which there are `len(s)`. A notebook shows it.

    `rows` are the runs, `keys` the varied keys, `folder` contains `files`, None in memory.
    `spread` has, if points were repeated, a row for each point: `runs`, `whole_runs` (that lasted
    as long as the scene says), and of these for each column of numbers `NAME q25`, `NAME median`
    and `NAME q75`; else it is empty.
    """

    rows: list[dict[str, Any]]
    keys: tuple[str, ...]
    folder: Path | None
    files: tuple[str, ...] = ()

    @property
    def columns(self) -> list[str]:
        """The names of the columns, varied keys first."""
        return table.columns(self.rows)

    @property
    def failed(self) -> list[dict[str, Any]]:
        """The rows of failed runs, with the reason in `end` and `message`."""
        return [r for r in self.rows if r["end"] in row.FAILED]

    @property
    def spread(self) -> list[dict[str, Any]]:
        """Median and quartiles of the repetitions of each point."""
        repeated = any(repeats.REPETITION in r for r in self.rows)
        return repeats.spread(self.rows, self.keys) if repeated else []

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, column: str) -> NDArray[Any]:
        """A column as numbers, NaN where a run has none, or as text if an entry is no number.
        Raises KeyError with a hint for an unknown name."""
        if column not in self.columns:
            raise KeyError(unknown("column", column, self.columns))
        cells = [str(r.get(column, "")) for r in self.rows]
        numbers = [grid.number(cell) if cell else np.nan for cell in cells]
        return np.array(numbers if any(cells) and None not in numbers else cells)

    def frame(self) -> pd.DataFrame:
        """The table as a pandas frame. Raises InputFault if pandas is not installed."""
        return frame({name: self[name] for name in self.columns})

    def figure(self, metric: str | None = None) -> Figure | None:
        """A Matplotlib figure of a column (`metric`, by default the largest tracking error) against
        the varied keys; None if there is no number to draw. Raises InputFault for a metric that is
        no column of numbers."""
        return sweep_figure.draw(self.rows, self.keys, metric)

    def __str__(self) -> str:
        """The lines of `hapticlink sweep`."""
        lines = repeats.lines if self.spread else table.lines
        return "\n".join(lines(self.rows, self.keys))

    def _repr_html_(self) -> str:
        shown = self.spread or self.rows
        columns = table.columns(shown)
        return html_table(columns, ([run.get(name, "") for name in columns] for run in shown))

    def __repr__(self) -> str:
        return f"{self}\n  columns: {', '.join(self.columns)}"


def sweep(
    scene: str | Path | Scene,
    vary: Vary = (),
    options: Options = (),
    *,
    runs: Runs = (),
    repeat: int = 1,
    out: str | Path | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    metric: str | None = None,
    format: str = "png",
    progress: Callable[[int, int], None] | None = None,
) -> Sweep:
    """Run many variants of a scene in parallel, in a pool of processes.

    `vary` gives each key its values, `{"graphics.rate": range(10, 61, 10), "hold": ["zoh", "foh"]}`
    or, as on the command line, `["graphics.rate=10..60..10", "hold=zoh,foh"]`; every combination is
    run. Alternatively `runs` lists the options of each run, or is a file with them. `options` (see
    `scene`) apply to all runs. `repeat` is the number of runs of each point, with other seeds of
    what is drawn: rates that vary, latency and loss, noise. The seeds are columns of the table.

    The table is returned, and with `out` also written to that folder: table.csv, sweep.png (of the
    column `metric`; `format` as in `run`) and a file per row, so that an interrupted sweep can be
    continued by the same call. `jobs` is the number of runs at a time, by default one per
    processor; `scheduler` is the address of a Dask scheduler to run on. `progress` is called with
    the numbers of finished and of all runs.

    A run that fails is a row of the table. Raises InputFault for invalid input, if every run is
    refused, and for `repeat` if nothing is drawn; Fault if the sweep is interrupted.
    """
    if repeat < 1:
        raise InputFault(f"--repeat {repeat}: give 1 or more")
    processes, formats = count_processes(jobs), figure_files.formats(format)
    varied = points(vary, runs)
    made = job.jobs(scene, overrides.write_options(options), varied, repeat)
    if metric:
        sweep_figure.check_metric(metric, [j.scene for j in made if j.scene])
    keys = tuple(dict.fromkeys(key for point in varied for key in point))

    def into(folder: Path) -> list[row.Row]:
        return make(made, Means(folder, processes, progress, scheduler))

    if out is None:
        with temporary_folders.temporary_folder() as room:
            try:
                return Sweep(into(room), keys, None)
            except Unfinished as left:
                advice = "with a folder `out` they are kept, and the same call continues"
                raise Fault(f"interrupted: {left.done} of {left.of} runs; {advice}") from None
    folder = folders.ensure(out)
    found = Sweep(into(folder), keys, folder, ("table.csv",))
    if spread := found.spread:
        table.write(folder / SPREAD, spread)
        found = replace(found, files=(*found.files, SPREAD))
    drawn = sweep_figure.write_figure(folder, found.rows, keys, metric, formats)
    return replace(found, files=(*found.files, *drawn))
