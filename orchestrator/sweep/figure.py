"""The figure of a sweep: a metric against the first numeric key, one line for each combination
of the others; two numeric keys with many values each make a map."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticlink.orchestrator.base.faults import InputFault, unknown
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.sweep.grid import number
from hapticlink.orchestrator.sweep.row import METRIC, Row
from hapticlink.orchestrator.sweep.table import columns
from hapticlink.orchestrator.sweep.title import axis, title

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = {
    METRIC: "largest tracking error (mm)",
    "tracking_rms_mm": "RMS tracking error (mm)",
    "theta_max_rad": "largest tracking error in theta (rad)",
    "theta_rms_rad": "RMS tracking error in theta (rad)",
    "closure_max_m": "largest closure error (m)",
    "held_energy_made_J": "energy made by the holds (J)",
    "end_time_s": "end of the run (s)",
    "run_time_s": "run time (s)",
}
FEW = 8
"""Lines that colours can still tell apart; more differ by their dashes too."""
GOOD = ("duration",)


def check(metric: str, scenes: Sequence[Scene]) -> None:
    """Raises InputFault, before anything runs, for a metric that no run of `scenes` can have. What
    a hold made is known only then."""
    fmus = {b.name for s in scenes for b in blocks(s)} | {f.name for s in scenes for f in s.fmu}
    known = (*NAMES, "switches", *(f"steps {name}" for name in sorted(fmus)))
    if metric not in known and not metric.startswith("made_J "):
        raise InputFault(f"--metric {unknown('column of numbers', metric, known)}")


def draw(rows: Sequence[Row], keys: Sequence[str], metric: str | None = None) -> Figure | None:
    """The figure; None where no row has a number to draw. Raises InputFault for a metric that is no
    column."""
    known = [c for c in columns(rows) if any(isinstance(r.get(c), int | float) for r in rows)]
    if known and metric and metric not in known:
        raise InputFault(f"--metric {metric}: no column of numbers; there are {', '.join(known)}")
    metric = metric or next((c for c in (*NAMES, *known) if c in known), None)
    if metric not in known:
        return None
    numeric = [k for k in keys if all(number(r.get(k, "")) is not None for r in rows)]
    others = [k for k in keys if k not in numeric[:1]]
    lines = len({_label(r, others) for r in rows})
    figure, axes = _axes(wide=lines > 1)
    if len(numeric) > 1 and len(keys) == 2 and lines > FEW:
        _map(figure, axes, rows, numeric[0], numeric[1], metric)
    elif numeric:
        _lines(axes, rows, numeric[0], others, metric)
    else:
        _bars(axes, rows, keys, metric)
    best = min((r for r in rows if _shown(r, metric)), key=lambda r: r[metric], default=None)
    if best:
        lost = sum(not _shown(r, metric) for r in rows)
        found = title(best, best[metric], NAMES.get(metric, metric), keys, lost, len(rows))
        axes.set_title(fill(found, 80), fontsize="medium")
    return figure


def save(figure: Figure, path: Path) -> None:
    """The same rows give the same bytes: without the software's version."""
    figure.savefig(path, dpi=130, metadata={"Software": None})


def _axes(wide: bool) -> tuple[Figure, Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4 if wide else 6.4, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.grid(alpha=0.3)
    return figure, axes


def _label(row: Row, keys: Iterable[str]) -> str:
    return ", ".join(str(row.get(k, "as in the scene")) for k in keys)


def _shown(row: Row, metric: str) -> bool:
    value = row.get(metric)
    return isinstance(value, int | float) and bool(np.isfinite(value)) and row["end"] in GOOD


def _lines(axes: Any, rows: Sequence[Row], x: str, others: Sequence[str], metric: str) -> None:
    from matplotlib import colormaps

    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(_label(row, others), []).append(row)
    colours = colormaps["tab10"](range(FEW))
    drawn = []
    for i, (label, group) in enumerate(groups.items()):
        group.sort(key=lambda r: float(r[x]))
        at = np.array([float(r[x]) for r in group])
        value = np.array([r[metric] if _shown(r, metric) else np.nan for r in group])
        colour, dash = colours[i % FEW], ("-", "--", ":", "-.")[i // FEW % 4]
        axes.plot(at, value, dash, color=colour, marker=".", label=label or None)
        drawn += [v for v in value if np.isfinite(v)]
        bad = [float(r[x]) for r in group if not _shown(r, metric)]
        # Ended early: on the upper edge, a little apart for each line.
        axes.plot(
            bad, [0.99 - 0.02 * (i % 20)] * len(bad), "x", color=colour, ms=5,
            transform=axes.get_xaxis_transform(), clip_on=False,
        )  # fmt: skip
    if any(not _shown(r, metric) for r in rows):
        axes.plot([], [], "kx", label="ended early or failed")
    _scale(axes, drawn)
    axes.set(xlabel=axis(x), ylabel=NAMES.get(metric, metric))
    if len(groups) > 1 or any(not _shown(r, metric) for r in rows):
        title = ", ".join(others) if others else None
        axes.legend(
            title=title, fontsize="small", loc="center left", bbox_to_anchor=(1.01, 0.5),
            ncols=1 + len(groups) // 24,
        )  # fmt: skip


def _map(figure: Any, axes: Any, rows: Sequence[Row], x: str, y: str, metric: str) -> None:
    xs, ys = (sorted({float(r[k]) for r in rows}) for k in (x, y))
    values = np.full((len(ys), len(xs)), np.nan)
    for r in rows:
        if _shown(r, metric):
            values[ys.index(float(r[y])), xs.index(float(r[x]))] = r[metric]
    axes.set_facecolor("0.85")  # where a run ended early or failed
    axes.grid(False)
    found = values[np.isfinite(values)]
    wide = found.size and found.min() > 0 and found.max() > 30 * found.min()
    mesh = axes.pcolormesh(xs, ys, values, shading="nearest", norm="log" if wide else "linear")
    figure.colorbar(mesh, label=f"{NAMES.get(metric, metric)}; grey: ended early or failed")
    axes.set(xlabel=axis(x), ylabel=axis(y))


def _bars(axes: Any, rows: Sequence[Row], keys: Sequence[str], metric: str) -> None:
    labels = [_label(r, keys) for r in rows]
    values = [r[metric] if _shown(r, metric) else np.nan for r in rows]
    axes.barh(range(len(rows)), values, tick_label=labels)
    for i, value in enumerate(values):
        if np.isnan(value):
            axes.text(
                0.01, i, f" {rows[i]['end']}", va="center", transform=axes.get_yaxis_transform()
            )
    axes.invert_yaxis()
    axes.set(xlabel=NAMES.get(metric, metric), ylabel=", ".join(keys))


def _scale(axes: Any, values: Sequence[float]) -> None:
    """Logarithmic where linear would hide most of it."""
    if values and min(values) > 0 and max(values) > 30 * min(values):
        axes.set_yscale("log")
