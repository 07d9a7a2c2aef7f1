"""The figure of a map: growth rate at the grid's points, the boundary, the closed form where there
is one, and the points that runs have checked."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from hapticlink.analysis.maps import wall_closed_form
from hapticlink.analysis.sweep.row import Row
from hapticlink.visualization.figure_axes import headline, plain
from hapticlink.visualization.figures.sweep_figure import axis

if TYPE_CHECKING:
    from hapticlink.analysis.maps.stability_map import Map

COLUMNS = 3
FINE = 160
"""Points of the closed form along each key."""


def draw(made: Map) -> Figure:
    """The figure of a map, a panel for each value of its further keys."""
    panels: dict[tuple[str, ...], list[Row]] = {}
    for row in made.rows:
        panels.setdefault(tuple(row[k] for k in made.panels), []).append(row)
    across = 4 if len(panels) % 4 == 0 else min(COLUMNS, len(panels))
    down = -(-len(panels) // across)
    figure = Figure(figsize=(1.2 + 3.8 * across, 0.9 + 3.2 * down), layout="constrained")
    all_axes = figure.subplots(down, across, squeeze=False, sharex=True).ravel()
    rates = [abs(r["growth_rate"]) for r in made.of("grid") if "growth_rate" in r]
    top = float(np.quantile(rates, 0.95)) if rates else 1.0
    norm = SymLogNorm(linthresh=max(top / 100, 1e-9), vmin=-top, vmax=top)
    mesh = None
    for axes, (values, rows) in zip(all_axes, panels.items(), strict=False):
        panel = _panel(axes, made, rows, norm)
        mesh = panel or mesh
        if not made.panels:
            continue
        named = zip(made.panels, values, strict=True)
        text = ", ".join(f"{_short(key)} = {value}" for key, value in named)
        axes.set_title(plain(fill(text, 36)), fontsize="small")
    for axes in all_axes[len(panels) :]:
        axes.remove()
    for axes in all_axes[::across]:
        axes.set_ylabel(axis(made.y) if made.y else "growth rate (1/s)", fontsize="small")
    for axes in all_axes[max(0, len(panels) - across) : len(panels)]:
        axes.set_xlabel(axis(made.x), fontsize="small")
        axes.tick_params(labelbottom=True)
    if mesh is not None:
        figure.colorbar(
            mesh, ax=list(all_axes[: len(panels)]), label="growth rate (1/s)", shrink=0.8
        )
    handles: dict[str, Any] = {}
    for axes in all_axes[: len(panels)]:
        found_handles, labels = axes.get_legend_handles_labels()
        handles.update(zip(labels, found_handles, strict=True))
    shown = list(handles.values()), list(handles)
    headline(figure, _finding(made), int(11 * figure.get_figwidth()))
    figure.legend(*shown, loc="outside lower center", ncols=4, fontsize="small")
    return figure


def _finding(made: Map) -> str:
    """How many points are stable, at which values of a key all of them are, and how many runs
    agree."""
    grid = made.of("grid")
    stable = [row for row in grid if row["verdict"] == "stable"]
    text = f"{len(stable)} of {len(grid)} points are stable"
    for key in filter(None, (made.y, made.x)):
        others = {float(row[key]) for row in grid if row["verdict"] != "stable"}
        always = sorted({float(row[key]) for row in stable} - others)
        if others and always:
            between = [value for value in others if always[0] < value < always[-1]]
            if not between:
                last = f" to {always[-1]:g}" if len(always) > 1 else ""
                text += f", all with {axis(key)} {always[0]:g}{last}"
                break
    checks = [row for row in made.of("check") if "agree" in row]
    if checks:
        text += f"; {sum(bool(r['agree']) for r in checks)} of {len(checks)} runs agree"
    return text


def _short(key: str) -> str:
    """A key without its quotes: `holds wall.F`."""
    head, quote, name = key.partition('."')
    return f"{head} {name.rstrip(chr(34))}" if quote else key


def _panel(axes: Any, made: Map, rows: Sequence[Row], norm: Any) -> Any:
    grid = [r for r in rows if r["at"] == "grid"]
    x, y = made.x, made.y
    if y is None:
        drawn = sorted((float(r[x]), r["growth_rate"]) for r in grid if "growth_rate" in r)
        axes.plot(*zip(*drawn, strict=True), ".-", label="growth rate")
        axes.axhline(0.0, color="0.5", lw=0.8)
        _points(axes, rows, x, None)
        return None
    xs, ys = (sorted({float(r[k]) for r in grid}) for k in (x, y))
    field = np.full((len(ys), len(xs)), np.nan)
    for r in grid:
        if "growth_rate" in r:
            field[ys.index(float(r[y])), xs.index(float(r[x]))] = r["growth_rate"]
    axes.set_facecolor("0.8")
    mesh = axes.pcolormesh(xs, ys, field, cmap="RdBu_r", norm=norm, shading="nearest", alpha=0.6)
    xlim, ylim = axes.get_xlim(), axes.get_ylim()
    wide = np.meshgrid(np.linspace(xs[0], xs[-1], FINE), np.linspace(ys[0], ys[-1], FINE))
    form = wall_closed_form.form(made.scene, {k: grid[0][k] for k in made.panels}, x, y)
    if form:
        axes.contour(*wide, form(*wide), levels=[1.0], colors="k", linewidths=1.0)
        axes.plot([], [], "k-", lw=1.0, label="closed form")
        margin = wall_closed_form.passive_margin(form, *wide)
        axes.contour(*wide, margin, levels=[0.0], colors="k", linewidths=0.8, linestyles="dashed")
        axes.plot([], [], "k--", lw=0.8, label="passive for any hand (Colgate, Schenkel)")
    _points(axes, rows, x, y)
    axes.set(xlim=xlim, ylim=ylim)
    return mesh


def _points(axes: Any, rows: Sequence[Row], x: str, y: str | None) -> None:
    def at(chosen: Sequence[Row]) -> tuple[list[float], list[float]]:
        upward = [float(r[y]) if y else float(r["growth_rate"]) for r in chosen]
        return [float(r[x]) for r in chosen], upward

    edge = [r for r in rows if r["at"] == "boundary"]
    checks = [r for r in rows if r["at"] == "check" and "agree" in r]
    axes.plot(*at(edge), "k.", ms=4, label="boundary of the lifted map")
    for verdict, style in (("stable", "o"), ("unstable", "^")):
        chosen = [r for r in checks if r["run_verdict"] == verdict and r["agree"]]
        axes.plot(*at(chosen), style, mfc="none", mec="tab:green", ms=5, label=f"run: {verdict}")
    wrong = [r for r in checks if not r["agree"]]
    if wrong:
        axes.plot(*at(wrong), "x", color="magenta", ms=7, label="run contradicts the map")
