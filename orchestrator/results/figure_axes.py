"""Figures with titled axes, of a size that README pages and slides can show."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticlink.orchestrator.results.tables import Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ENDS = {
    "stop_when": "stop_when ended the run",
    "terminated": "an FMU ended the run",
    "diverged": "the run diverged",
    "interrupted": "the run was interrupted",
    "running": "the last row so far",
}


def last_time(results: Results) -> float:
    """The time (s) of the last row of the first table."""
    rows = next(iter(results.tables.values()))["time"]
    return float(rows[-1]) if len(rows) else 0.0


def short(value: float) -> str:
    """A number with three significant digits, with an exponent only if very large or small."""
    if value and not 1e-3 <= abs(value) < 1e6:
        return f"{value:.3g}"
    return np.format_float_positional(value, precision=3, fractional=False, trim="-")


def titled(results: Results, title: str, x: str, *y: str) -> tuple[Figure, Any]:
    """A figure whose title tells where a run ended early, and its axes: one, or one below the other
    for several labels y."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    end = results.run["end"]
    if end["reason"] != "duration":
        why = _ENDS.get(end["reason"], "a fault ended the run")
        title += f", until {why} at {short(last_time(results))} s"
    figure = Figure(figsize=(6.4, 4.4 + 1.2 * (len(y) - 1)), layout="constrained")
    FigureCanvasAgg(figure)
    every = figure.subplots(len(y), 1, sharex=True, squeeze=False)[:, 0]
    for axes, label in zip(every, y, strict=True):
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
    every[0].set_title(fill(title, 70), fontsize="medium")
    every[-1].set_xlabel(x)
    return figure, every if len(y) > 1 else every[0]
