"""The share of haptic ticks whose step time or lateness exceeds a time, with the deadline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hapticlink.analysis.findings.summary import deadlines
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.visualization.figure_axes import titled_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Histogram = Sequence[tuple[float, int]]
"""Upper ends (s) of bins, and their counts."""
LEAST = 1e-7
"""Times (s) below it are drawn there."""


def real_time(
    results: Results, curves: Mapping[str, Histogram] | None = None, more: str = ""
) -> Figure:
    """The figure of a run in real time that had a tick, with further `curves` by their labels and
    `more` said in its title."""
    report = results.record.real_time
    assert report
    title = "; ".join(filter(None, (deadlines(report), more)))
    figure, axes = titled_axes(results, title, "time (ms)", "share of ticks that exceed it")
    histograms = report["histograms"]
    own = {"step time": histograms["step_time"], "lateness": histograms["lateness"]}
    for (label, histogram), style in zip(
        {**own, **(curves or {})}.items(), ("-", "--", ":", "-."), strict=False
    ):
        axes.step(*exceedance(histogram), style, where="post", label=label)
    axes.axvline(1e3 * report["period"], color="k", lw=1)
    axes.annotate(
        "deadline",
        (1e3 * report["period"], 0.5),
        (3, 0),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        rotation=90,
    )
    axes.set(xscale="log", yscale="log")
    axes.legend(fontsize="small")
    return figure


def exceedance(histogram: Histogram) -> tuple[np.ndarray, np.ndarray]:
    """Times (ms), and the share of the values above each."""
    times, counts = np.array(histogram, dtype=np.float64).reshape(-1, 2).T
    above = 1.0 - np.cumsum(counts) / counts.sum()
    return 1e3 * np.maximum(np.append(LEAST, times), LEAST), np.append(1.0, above)
