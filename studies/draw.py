"""Layout and colours that the figures of studies and benchmarks share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#777777"


def panels(
    count: int, *, rows: int = 1, width: float = 4.6, height: float = 3.8, **options: Any
) -> Any:
    """A figure and its `count` axes side by side, or in `rows` rows of as many, one after the
    other; `width` and `height` of each in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width * count, height * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, count, squeeze=False, **options).ravel()
    for each in axes:
        each.grid(alpha=0.3)
    return figure, axes


def save(figure: Any, folder: Path, name: str) -> str:
    """Write a figure as `name` in `folder`; returns the name."""
    # Without the software's version and date the same run gives the same bytes.
    figure.savefig(folder / name, dpi=130, metadata={"Software": None})
    return name
