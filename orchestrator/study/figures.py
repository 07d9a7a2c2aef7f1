"""Maps of the study: holds against rates, with the number in each cell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hapticlink.orchestrator.report.draw import save
from hapticlink.orchestrator.study.grids import COLUMNS, Grid, short


def maps(
    folder: Path,
    name: str,
    title: str,
    panels: Sequence[tuple[str, Grid]],
    label: str,
    signed: bool = False,
) -> str:
    """Draws grids side by side with one colour scale and a number in each cell; returns the file's
    name. The cell of a run that ends early is grey and has the time of the end (s). `signed`
    selects a diverging scale around 0."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = max(len(grid) for _, grid in panels)
    figure = Figure(figsize=(1.2 + 4.9 * len(panels), 1.9 + 0.32 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, len(panels), squeeze=False, sharey=True)[0]
    values = [c.value for _, g in panels for by in g.values() for c in by.values()]
    scale = _scale([v for v in values if v is not None], signed)
    for each, (heading, grid) in zip(axes, panels, strict=True):
        _map(each, grid, scale)
        each.set_title(heading, fontsize="medium")
    figure.suptitle(f"{title}\n{label}")
    return save(figure, folder, name)


def _scale(values: Sequence[float], signed: bool) -> Any:
    from matplotlib.colors import LogNorm, SymLogNorm

    if signed:
        most = max((abs(v) for v in values), default=1.0)
        return SymLogNorm(linthresh=most / 1000, vmin=-most, vmax=most)
    return LogNorm(min(values, default=0.1), max(values, default=1.0))


def _map(axes: Any, grid: Grid, scale: Any) -> None:
    from matplotlib import colormaps

    values = np.array(
        [[np.nan if by[r].value is None else by[r].value for r in COLUMNS] for by in grid.values()],
        dtype=float,
    )
    diverging = scale.vmin < 0
    colours = colormaps["RdBu_r" if diverging else "viridis_r"].with_extremes(bad="0.85")
    axes.imshow(values, cmap=colours, norm=scale, aspect="auto")
    for i, by in enumerate(grid.values()):
        for k, rate in enumerate(COLUMNS):
            cell = by[rate]
            if cell.value is None:
                text, colour = f"{cell.end:.1f} s", "0.35"
            else:
                text = short(cell.value)
                shade = colours(scale(cell.value))
                colour = "white" if np.dot(shade[:3], (0.3, 0.6, 0.1)) < 0.5 else "black"
            axes.text(k, i, text, ha="center", va="center", fontsize=7.5, color=colour)
    axes.set_xticks(range(len(COLUMNS)), COLUMNS)
    axes.set_yticks(range(len(grid)), list(grid))
    axes.set_xlabel("graphics rate (Hz)")
