"""Heat maps of the study: methods against graphics rates, a number in each cell, a colour bar with
its unit. Cells without a number are hatched, and the legend says why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np

from studies.report.draw import save


class Square(NamedTuple):
    """What a cell shows: a value, or None with a text; `marked` is drawn in bold with a frame."""

    value: float | None
    text: str = ""
    marked: bool = False


Panel = tuple[str, Mapping[str, Mapping[str, Square]]]
"""A heading, and squares by row and column."""
STRONGEST = 20.0
"""Where a signed scale ends."""
HATCH: dict[str, Any] = {
    "facecolor": "0.88",
    "edgecolor": "0.65",
    "hatch": "////",
    "linewidth": 0.0,
}


def short(value: float | None) -> str:
    """A number with two significant digits and no exponent; "" for None and NaN."""
    if value is None or value != value:
        return ""
    return f"{float(f'{value:.2g}'):.10g}"


def maps(
    folder: Path,
    name: str,
    title: str,
    panels: Sequence[Panel],
    unit: str,
    without: str,
    marked: str = "",
    scale: str = "log",
) -> str:
    """Draws panels side by side with one colour scale; returns the file's name. unit: the label of
    the colour bar; without, marked: what hatched and framed cells mean; scale: "log",
    "linear", or "signed", a linear one around 0."""
    from matplotlib import colormaps
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    rows = max(len(squares) for _, squares in panels)
    figure = Figure(figsize=(2.6 + 4.2 * len(panels), 2.1 + 0.33 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, len(panels), squeeze=False, sharey=True)[0]
    values = [s.value for _, p in panels for by in p.values() for s in by.values()]
    norm = _norm([v for v in values if v is not None], scale)
    colours = colormaps["RdBu" if scale == "signed" else "viridis_r"]
    for each, (heading, squares) in zip(axes, panels, strict=True):
        _map(each, squares, norm, colours)
        each.set_title(heading, fontsize="medium")
    bar = figure.colorbar(ScalarMappable(norm, colours), ax=list(axes), label=unit)
    bar.ax.yaxis.set_major_formatter("{x:g}")
    narrow = 0 < norm.vmax < 20 * norm.vmin
    bar.ax.yaxis.set_minor_formatter("{x:g}" if narrow else "")
    patches = [Patch(**HATCH, label=without)] if None in values else []
    if marked:
        patches.append(Patch(facecolor="white", edgecolor="black", linewidth=1.6, label=marked))
    if patches:
        figure.legend(handles=patches, loc="outside lower center", ncols=2, fontsize="small")
    figure.suptitle(fill(title, 46 * len(panels) + 10))
    return save(figure, folder, name)


def _norm(values: Sequence[float], scale: str) -> Any:
    from matplotlib.colors import LogNorm, Normalize, TwoSlopeNorm

    most = max((abs(v) for v in values), default=1.0)
    if scale == "signed":
        most = min(most, STRONGEST)
        return TwoSlopeNorm(0.0, -most, most)
    if scale == "linear":
        return Normalize(0.0, most)
    least = min((v for v in values if v > 0), default=most)
    return LogNorm(min(least, 0.99 * most), most, clip=True)


def _map(axes: Any, squares: Mapping[str, Mapping[str, Square]], norm: Any, colours: Any) -> None:
    from matplotlib.patches import Rectangle

    columns = list(next(iter(squares.values())))
    for i, by in enumerate(squares.values()):
        for k, column in enumerate(columns):
            square, corner = by[column], (k - 0.5, i - 0.5)
            if square.value is None:
                axes.add_patch(Rectangle(corner, 1, 1, **HATCH))
                dark = "0.3"
            else:
                shade = colours(float(norm(square.value)))
                axes.add_patch(Rectangle(corner, 1, 1, facecolor=shade, edgecolor="white"))
                dark = "white" if np.dot(shade[:3], (0.3, 0.6, 0.1)) < 0.5 else "black"
            text = square.text or short(square.value)
            weight = "bold" if square.marked else "normal"
            axes.text(k, i, text, ha="center", va="center", fontsize=8, color=dark, weight=weight)
            if square.marked:
                inner = (k - 0.46, i - 0.44)
                frame: dict[str, Any] = {
                    "fill": False,
                    "edgecolor": "black",
                    "linewidth": 1.6,
                    "zorder": 3,
                }
                axes.add_patch(Rectangle(inner, 0.92, 0.88, **frame))
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(squares) - 0.5, -0.5))
    axes.set_xticks(range(len(columns)), columns)
    axes.set_yticks(range(len(squares)), list(squares))
    axes.set_xlabel("graphics rate (Hz)")
