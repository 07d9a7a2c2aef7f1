"""Figures of the study: numbers over the graphics rate, a line for each of a few methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

from studies.draw import BLUE, GREEN, GREY, ORANGE, panels, save
from studies.mismatch.methods import RATES, VARIABLE


class Point(NamedTuple):
    """A number at a rate; hollow unless `whole`, ringed where `taken`."""

    value: float
    whole: bool = True
    taken: bool = False


Panel = tuple[str, Mapping[str, Mapping[str, Point]]]
"""A heading, and points by line and rate."""
COLOURS = (BLUE, ORANGE, GREEN, "#cc79a7", "#333333")
"""Of the lines that a figure names; all others are grey."""
APART = 90.0
"""Where on the axis the rate that varies is drawn, with no line to it."""


def short(value: float | None) -> str:
    """A number with two significant digits and no exponent; "" for None and NaN."""
    if value is None or value != value:
        return ""
    return f"{float(f'{value:.2g}'):.10g}"


def lines(
    folder: Path,
    name: str,
    title: str,
    drawn: Sequence[Panel],
    unit: str,
    named: Sequence[str],
    *,
    hollow: str = "",
    scale: str = "log",
    others: str = "other holds",
) -> str:
    """Draws panels side by side with one scale; returns the file's name. named: the lines with a
    colour; hollow: what hollow points mean; scale: as Matplotlib names it."""
    from matplotlib.ticker import LogLocator

    figure, every = panels(len(drawn), width=5.2, height=4.4, sharey=True)
    for axes, (heading, by_line) in zip(every, drawn, strict=True):
        for label, points in by_line.items():
            _line(axes, label, points, named, others)
        axes.set_title(heading, fontsize="medium")
        axes.set_yscale(scale, **({"linthresh": 1.0} if scale == "symlog" else {}))
        if scale == "log":
            axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_xscale("log")
        axes.set_xlabel("graphics rate (Hz)")
        axes.set_xticks([*map(float, RATES), APART], [*RATES, VARIABLE], fontsize="x-small")
        axes.minorticks_off()
    every[0].set_ylabel(unit)
    found: dict[str, Any] = {}
    for axes in every:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    shown = {label: found[label] for label in (*named, others) if label in found}
    shown |= _marks(drawn, hollow)
    where: dict[str, Any] = {"loc": "outside lower center", "ncols": 2 * len(drawn)}
    figure.legend(shown.values(), shown.keys(), fontsize="small", **where)
    figure.suptitle(fill(title, 46 * len(drawn) + 10))
    return save(figure, folder, name)


def _line(
    axes: Any, label: str, points: Mapping[str, Point], named: Sequence[str], others: str
) -> None:
    """One line, its points, and the one at the rate that varies."""
    front = label in named
    style: dict[str, Any] = {
        "color": COLOURS[list(named).index(label)] if front else GREY,
        "alpha": 1.0 if front else 0.5,
        "linewidth": 1.6 if front else 0.7,
        "zorder": 3 if front else 2,
        "label": label if front else others,
    }
    fixed = {float(rate): p for rate, p in points.items() if rate != VARIABLE}
    axes.plot(list(fixed), [p.value for p in fixed.values()], **style)
    for x, p in (*fixed.items(), *((APART, p) for r, p in points.items() if r == VARIABLE)):
        if front:
            face = style["color"] if p.whole else "white"
            axes.plot(x, p.value, "o", ms=4.5, mfc=face, mec=style["color"], zorder=4)
        if p.taken:
            axes.plot(x, p.value, "o", ms=10, mfc="none", mec="black", zorder=5)


def _marks(drawn: Sequence[Panel], hollow: str) -> dict[str, Any]:
    """Legend entries of hollow and ringed points, where there are any."""
    from matplotlib.lines import Line2D

    every = [p for _, by in drawn for points in by.values() for p in points.values()]
    found = {}
    if not all(p.whole for p in every):
        found[hollow] = Line2D([], [], ls="", marker="o", ms=4.5, mfc="white", mec="black")
    if any(p.taken for p in every):
        found["advised"] = Line2D([], [], ls="", marker="o", ms=10, mfc="none", mec="black")
    return found
