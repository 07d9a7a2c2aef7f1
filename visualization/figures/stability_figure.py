"""The figure of a verdict: the leading mode of each hand in each pose, by frequency and growth."""

from __future__ import annotations

from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hapticlink.analysis.stability.verdict_record import Stability
from hapticlink.visualization.figure_axes import headline, plain

COLOURS = {"stable": "tab:green", "marginal": "0.6", "unstable": "tab:red", "drift": "tab:orange"}


def draw(found: Stability) -> Figure:
    """A table of growth rates, hands by poses, with the verdict of each that is not stable."""
    poses = list(dict.fromkeys(case.pose for case in found.cases))
    hands = list(dict.fromkeys(case.hand for case in found.cases))
    figure = Figure(figsize=(3.2 + 1.5 * len(poses), 1.6 + 0.42 * len(hands)), layout="constrained")
    axes: Axes = figure.subplots()
    for case in found.cases:
        said = "drift" if case.drifts else case.verdict
        x, y = poses.index(case.pose), hands.index(case.hand)
        axes.fill_between([x, x + 1], y, y + 1, color=COLOURS[said], alpha=0.45, lw=0)
        text = f"{case.growth:.2g} 1/s" + (f", {case.hertz:.2g} Hz" if case.hertz else "")
        text += f"\n{said}" if said != "stable" else ""
        axes.text(x + 0.5, y + 0.5, plain(text), ha="center", va="center", fontsize="small")
    axes.set_xticks(np.arange(len(poses)) + 0.5, [fill(pose, 16) for pose in poses])
    axes.set_yticks(np.arange(len(hands)) + 0.5, hands)
    axes.set_xlim(0, len(poses))
    axes.set_ylim(len(hands), 0)
    axes.tick_params(length=0)
    axes.set_xlabel("pose, by the time of the scene's run")
    axes.set_ylabel("hand")
    headline(figure, f"{found.title}: {found.finding}", 24 + 20 * len(poses))
    return figure
