"""Figures with titled axes, of a size that README pages and slides can show.

Margins are fixed and figures are drawn once: for one of Matplotlib's layout engines `savefig` draws
twice and measures every text twice, which takes longer than the rest of a short run.
"""

from __future__ import annotations

import re
from functools import cache
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticlink.analysis.findings.summary import describe_stop
from hapticlink.orchestrator.base.errors import shorten
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.visualization.curve_colours import CURVES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ENDS = {
    "stop_when": "stop_when ended the run",
    "terminated": "an FMU ended the run",
    "diverged": "the run diverged",
    "interrupted": "the run was interrupted",
    "running": "the last row so far",
    "stopped": "it was stopped",
    "reset": "it was reset",
}

WIDTH = 68
"""Letters in a line of title."""
MARGINS = {"left": 0.95, "right": 0.15, "bottom": 0.55, "top": 0.62}
"""Inches around the axes, with room for two lines of title above the exponent of an axis."""
LINE = 0.17
"""Height (in) of each further line of title."""
ROW, COLUMNS = 0.15, 3
"""Height (in) of a row of a legend below the axes, and the number of its columns."""


def plain(text: str) -> str:
    """A text that Matplotlib draws letter by letter; it takes what two dollar signs enclose for a
    formula, and fails where it is none. A letter that its fonts lack is a replacement character:
    `font.family` of a matplotlibrc names others."""
    there = _letters()
    known = (c if ord(c) in there or c.isspace() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return "".join(known).replace("$", r"\$")


@cache
def _letters() -> frozenset[int]:
    """The code points of Matplotlib's fonts."""
    from matplotlib import font_manager, rcParams

    families = (font_manager.FontProperties(family=[f]) for f in rcParams["font.family"])
    files = [font_manager.findfont(family) for family in families]
    return frozenset(code for file in files for code in font_manager.get_font(file).get_charmap())


def headline(on: Any, text: str, width: int, **where: Any) -> None:
    """Writes the finding of a figure or of its axes above it, in lines of `width` letters."""
    write = getattr(on, "suptitle", None) or on.set_title
    write(plain(in_lines(text, width)), fontsize="medium", **where)


def in_lines(text: str, width: int) -> str:
    """A text in as few lines of at most `width` letters as there can be, of about one length, none
    of which breaks between a number and its unit."""
    text = re.sub(r"(?<=\d) (?=([^\W\d]{1,2}|%)(\W|$))", "\N{NO-BREAK SPACE}", text)
    lines = fill(text, width)
    while width > 1 and (shorter := fill(text, width - 1)).count("\n") == lines.count("\n"):
        lines, width = shorter, width - 1
    return lines


def titled_axes(results: Results, title: str, x: str, *y: str) -> tuple[Figure, Any]:
    """A figure whose title tells where a run ended early and which rows are all that is known, and
    its axes: one, or one below the other for several labels y."""
    from hapticlink.visualization.shown_figure import ShownFigure  # loads Matplotlib

    reason = results.record.end.reason
    if reason != "duration":
        why = _ENDS.get(reason, "a fault ended the run")
        said = describe_stop(results.record.stop_when)
        if reason == "stop_when" and said.startswith("the device"):
            why = said
        title += f", until {why} at {short(results.last_time)} s"
    if (every := results.record.scene["record"]["every"]) > 1:
        title += f", in one row of {every}"
    further = LINE * max(in_lines(title, WIDTH).count("\n") - 1, 0)
    figure = ShownFigure(figsize=(6.4, 4.4 + 1.2 * (len(y) - 1) + further))
    set_margins(figure, top=MARGINS["top"] + further)
    every = figure.subplots(len(y), 1, sharex=True, squeeze=False)[:, 0]
    for axes, label in zip(every, y, strict=True):
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.set_prop_cycle(color=CURVES)
    headline(every[0], title, WIDTH, y=1.0, pad=12)  # at a fixed height
    every[-1].set_xlabel(x)
    if x == "time (s)":
        for axes in every:
            _events(axes, results)
    return figure, every if len(y) > 1 else every[0]


def _events(axes: Axes, results: Results) -> None:
    """A line at each time at which something happens in the scene, with its text."""
    texts: dict[float, list[str]] = {}
    events = results.run.get("events", ())
    end = results.last_time if events else 0.0
    for time, text in events:
        if time <= end:
            texts.setdefault(time, []).append(shorten(text, 60))
    for time, said in texts.items():
        axes.axvline(time, color="0.4", linestyle=":", linewidth=1)
        axes.annotate(
            plain("\n".join(said)), (time, 1), xycoords=("data", "axes fraction"), rotation=90,
            xytext=(-2, -3), textcoords="offset points", fontsize="xx-small", color="0.3",
            horizontalalignment="right", verticalalignment="top",
        )  # fmt: skip


def set_margins(figure: Figure, **margins: float) -> None:
    """Sets the margins of a figure's axes (in), by default those of MARGINS."""
    (width, height), m = figure.get_size_inches(), MARGINS | margins
    figure.subplots_adjust(
        m["left"] / width, m["bottom"] / height, 1 - m["right"] / width, 1 - m["top"] / height,
        hspace=0.12,
    )  # fmt: skip


def legend_below(figure: Figure) -> None:
    """A legend of all that is labelled, below the axes."""
    legend = figure.legend(fontsize="x-small", ncols=COLUMNS, loc="lower center", frameon=False)
    lines = [text.get_text().count("\n") + 1 for text in legend.get_texts()]
    tallest = max((sum(column) for column in np.array_split(lines, COLUMNS)), default=0)
    bottom = MARGINS["bottom"] + 0.1 + ROW * tallest
    figure.subplots_adjust(bottom=bottom / figure.get_figheight())


def legend_above_curves(axes: Axes, columns: int) -> None:
    """A legend at the top of the axes, which are extended so that it covers no curve."""
    legend = axes.legend(fontsize="x-small", ncols=columns, loc="upper left")
    rows = -(-len(legend.get_texts()) // columns)
    height = axes.get_window_extent().height / axes.figure.dpi
    covered = min((ROW * rows + 0.2) / height, 0.5)
    low, high = axes.get_ylim()
    axes.set_ylim(low, low + (high - low) / (1 - covered))
