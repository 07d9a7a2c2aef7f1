"""The figure of a tuning: felt stiffness before and after, and the margin at each rate."""

from __future__ import annotations

from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hapticlink.analysis.tune.felt_stiffness import HERTZ
from hapticlink.analysis.tune.tuning_result import Tuned
from hapticlink.visualization.figure_axes import headline

COLOURS = {"constraint": "tab:blue", "contact": "tab:orange"}
NAMES = {"scene": "the scene's gains", "tuned": "tuned"}


def draw(tuned: Tuned) -> Figure:
    """Bars of the felt stiffnesses and of the margins."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    _draw_felt(left, tuned)
    _margins(right, tuned)
    headline(figure, f"{tuned.title}: {tuned.finding}", 100)
    return figure


def _draw_felt(axes: Axes, tuned: Tuned) -> None:
    width = 0.8 / len(tuned.along)
    for i, name in enumerate(tuned.along):
        values = np.array([felt[name] for felt in tuned.felt.values()])
        places = np.arange(len(values)) + i * width
        bars = axes.bar(places, values, width, label=name, color=COLOURS[name])
        axes.bar_label(bars, fmt="%.0f", fontsize="small")
    axes.set_xticks(np.arange(2) + 0.4 - width / 2, list(NAMES.values()))
    axes.set_ylabel(f"felt stiffness at {HERTZ:g} Hz (N/m)")
    axes.margins(y=0.15)
    axes.legend(fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)


def _margins(axes: Axes, tuned: Tuned) -> None:
    names = [fill(NAMES.get(pose, pose), 24) for pose in tuned.margins]
    bars = axes.barh(names, list(tuned.margins.values()), 0.6, color="0.6")
    clear = {"facecolor": "white", "edgecolor": "none", "pad": 1}  # of the lines
    axes.bar_label(bars, fmt="%.3g", fontsize="small", padding=3, bbox=clear)
    axes.axvline(1.0, color="tab:red", lw=1.0, label="unstable below")
    axes.axvline(tuned.asked, color="0.2", lw=1.0, ls="--", label="asked for")
    axes.set_xlabel("margin: factor on all stiffnesses up to instability")
    axes.margins(x=0.12)
    axes.invert_yaxis()
    axes.legend(fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
