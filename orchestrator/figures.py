"""Quick figures of a haptic run, made by `run` beside its tables."""

from __future__ import annotations

from typing import Any

import numpy as np

from hapticlink.orchestrator.results import Results, Table
from hapticlink.orchestrator.tracking import DEVICE, MECHANISM, table_of, tracking


def draw(results: Results) -> list[str]:
    """Write what the run has signals for, and give the file names."""
    drawn = []
    if table_of(results, MECHANISM):
        drawn.append(_trajectories(results))
        if table_of(results, DEVICE):
            drawn.append(_distance(results))
    counting = next((t for t in results.tables.values() if _count(t)), None)
    if counting:
        drawn.append(_constraints(results, counting))
    return drawn


def _axes(title: str, x: str, y: str) -> tuple[Any, Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set(title=title, xlabel=x, ylabel=y)
    axes.grid(alpha=0.3)
    return figure, axes


def _save(figure: Any, results: Results, name: str) -> str:
    figure.savefig(results.folder / name, dpi=150)
    return name


def _trajectories(results: Results) -> str:
    paths = [
        (label, style, table[signal][:, :2] * 1e3)
        for signal, label, style in (
            (MECHANISM, "operational point", "-"),
            (DEVICE, "handle", "--"),
        )
        if (table := table_of(results, signal))
    ]
    if len(paths) == 2:
        title = f"Device and operational point part by at most {tracking(results)[1].max():.2g} mm"
    else:
        reach = np.linalg.norm(paths[0][2] - paths[0][2][0], axis=1).max()
        title = f"The operational point moves up to {reach:.3g} mm from its start"
    figure, axes = _axes(title, "x (mm)", "y (mm)")
    for label, style, path in paths:
        axes.plot(*path.T, style, label=label)
    axes.plot(*paths[0][2][0], "ko", label="start")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend()
    return _save(figure, results, "trajectories.png")


def _distance(results: Results) -> str:
    time, gap = tracking(results)
    at = int(gap.argmax())
    title = f"Distance device to operational point: at most {gap[at]:.2g} mm, at {time[at]:.2f} s"
    figure, axes = _axes(title, "time (s)", "distance |x_S - x_D| (mm)")
    axes.plot(time, gap)
    return _save(figure, results, "distance.png")


def _count(table: Table) -> str | None:
    names = (c for c in table.columns if c.endswith(".n_constraints"))
    return next(names, None)


def _constraints(results: Results, table: Table) -> str:
    name = _count(table)
    assert name is not None
    count, time = table[name], table["time"]
    most = int(count.max())
    share = 100 * float((count == most).mean())
    title = f"{most} resisted directions in {share:.3g} % of the samples"
    figure, axes = _axes(title, "time (s)", "resisted directions")
    axes.step(time, count, where="post")
    axes.set_yticks(range(most + 2))
    return _save(figure, results, "constraints.png")
