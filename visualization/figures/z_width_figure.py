"""The figure of a Z-width: the largest stable and the largest passive value over the first numeric
key, a colour for each combination of the others."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hapticlink.analysis.maps.z_width import AT_LEAST, PASSIVE, QUIET, STABLE
from hapticlink.analysis.sweep.grid import Axis, number
from hapticlink.analysis.sweep.row import Row
from hapticlink.orchestrator.results.numbers import short
from hapticlink.visualization.curve_colours import CURVES
from hapticlink.visualization.figure_axes import headline, plain
from hapticlink.visualization.figures.sweep_figure import axis, setting

STYLES = {
    STABLE: ("-", "stable in its own hand"),
    PASSIVE: ("--", "passive for any hand"),
    QUIET: (":", "without limit cycles of counts"),
}

WIDEST = 50
"""Letters of a line of the legend that leave room for another beside it."""


def draw(rows: Sequence[Row], key: str, axes: Sequence[Axis]) -> Figure:
    """The figure of rows over `axes`, of the largest values of a key. A triangle is the end of a
    search, above which no limit was looked for."""
    x = next((a for a in axes if all(number(v) is not None for v in a.values)), axes[0])
    others = [a.key for a in axes if a is not x]
    curves: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        curves.setdefault(tuple(row[k] for k in others), []).append(row)
    figure = Figure(figsize=(7.2, 4.8), layout="constrained")
    panel = figure.subplots()
    handles = []
    for i, (values, each) in enumerate(curves.items()):
        colour = CURVES[i % len(CURVES)]
        for what, (style, _) in STYLES.items():
            found = [
                (_place(x, row), row[f"largest_{what}"], row[what]) for row in each if row.get(what)
            ]
            found = [item for item in found if item[1] > 0]
            if not found:
                continue
            at, largest, kinds = zip(*sorted(found), strict=True)
            panel.plot(at, largest, style, color=colour, marker=".", lw=1.3)
            ends = [k for k, kind in enumerate(kinds) if kind == AT_LEAST]
            panel.plot([at[k] for k in ends], [largest[k] for k in ends], "^", color=colour, ms=7)
        name = ", ".join(setting(k, v) for k, v in zip(others, values, strict=True))
        if others:
            handles.append(Line2D([], [], color=colour, label=plain(name)))
    drawn = [what for what in STYLES if any(row.get(f"largest_{what}") for row in rows)]
    handles += [Line2D([], [], color="k", ls=STYLES[w][0], label=STYLES[w][1]) for w in drawn]
    if any(row.get(what) == AT_LEAST for row in rows for what in STYLES):
        handles.append(
            Line2D([], [], color="k", marker="^", ls="", label="at least (end of search)")
        )
    panel.set(xlabel=axis(x.key), ylabel=f"largest {axis(key)}", yscale="log")
    panel.grid(visible=True, which="both", lw=0.3)
    headline(panel, finding(rows, [a.key for a in axes]), 90)
    columns = 1 if any(len(str(one.get_label())) > WIDEST for one in handles) else 2
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, fontsize="small")
    return figure


def finding(rows: Sequence[Row], keys: Sequence[str]) -> str:
    """A title with the smallest and the largest value with which it is stable, each with its point,
    and at how many points nothing that was tried is."""
    limits = [row for row in rows if row.get(f"largest_{STABLE}")]
    few = f"nothing stable found at {len(rows) - len(limits)} of {len(rows)} points"
    if not limits:
        return few.capitalize()

    def said(row: Row) -> str:
        point = ", ".join(setting(key, row[key]) for key in keys)
        at_least = "at least " if row[STABLE] == AT_LEAST else ""
        return f"{at_least}up to {short(row[f'largest_{STABLE}'])} at {point}"

    low, high = (end(limits, key=lambda row: row[f"largest_{STABLE}"]) for end in (min, max))
    parts = [f"Stable {said(low)}", *([said(high)] if high is not low else [])]
    return "; ".join([*parts, *([few] if len(limits) < len(rows) else [])])


def _place(x: Axis, row: Row) -> float:
    value = number(row[x.key])
    return float(x.values.index(row[x.key]) if value is None else value)
