"""Figures of several runs over each other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticlink.analysis.findings.forces import wrenches
from hapticlink.analysis.findings.tracking import (
    count_constrained,
    has_tracking,
    of_port,
    pose_error,
)
from hapticlink.analysis.findings.user_port import user_port
from hapticlink.orchestrator.base.signal_names import POINT_POSE
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results, Vector
from hapticlink.visualization.figure_axes import plain
from hapticlink.visualization.mechanism.mark_places import MM, on_page
from hapticlink.visualization.mechanism.view import view_of_run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLES = ("-", "--", "-.", ":")
Curves = dict[str, tuple[Vector, Vector]]


def figures(runs: Mapping[str, Results]) -> dict[str, Figure]:
    """Figures by name, of the runs by the names that tell them apart, as far as they have the
    signals."""
    over_time: dict[str, tuple[str, str, Curves]] = {
        "distance": (
            "Distance of handle to operational point: at most {} mm",
            "distance |x_S - x_D| (mm)",
            {n: pose_error(r)[:2] for n, r in runs.items() if has_tracking(r)},
        ),
        "forces": (
            "Largest of the hand's, coupling, topology and contact forces: at most {} N",
            "largest force (N)",
            {n: curve for n, r in runs.items() if (curve := _force(r))},
        ),
        "user_port": (
            "Energy generated at the user's port: at most {} mJ",
            "energy generated (mJ)",
            {
                n: (port.time_s, 1e3 * port.generated_J)
                for n, r in runs.items()
                if (port := user_port(r))
            },
        ),
        "constraints": (
            "At most {} constrained directions",
            "constrained directions",
            {n: counted for n, r in runs.items() if (counted := count_constrained(r))},
        ),
    }
    made = {
        name: _figure(title, "time (s)", y, curves, steps=name == "constraints")
        for name, (title, y, curves) in over_time.items()
        if any(len(time) for time, _ in curves.values())
    }
    views = {name: view_of_run(run) for name, run in runs.items()}
    paths: Curves = {}
    for name, view in views.items():
        if table := of_port(runs[name], POINT_POSE):
            right, up = on_page(table[POINT_POSE][:, : view.dimension] * MM, view).T
            paths[name] = right, up
    if paths:
        is_plane = all(view.dimension == 2 for view in views.values())
        axes = ("x (mm)", "y (mm)") if is_plane else ("to the right, as seen (mm)", "up (mm)")
        figure = _figure("Paths of the operational point", *axes, paths)
        figure.axes[0].set_aspect("equal", adjustable="datalim")
        made["paths"] = figure
    return made


def _force(run: Results) -> tuple[Vector, Vector] | None:
    """The largest force (N) of a kind at each time (s) of the most frequent ones."""
    forces = [(time, force) for _, time, force, _ in wrenches(run)]
    if not forces:
        return None
    times = max((time for time, _ in forces), key=len)
    return times, np.max([np.interp(times, time, force) for time, force in forces], axis=0)


def _figure(title: str, x: str, y: str, curves: Curves, steps: bool = False) -> Figure:
    from hapticlink.visualization.shown_figure import ShownFigure  # loads Matplotlib

    figure = ShownFigure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.add_subplot()
    style: Any = "steps-post" if steps else "default"
    for i, (time, values) in enumerate(curves.values()):
        axes.plot(time, values, STYLES[i % len(STYLES)], lw=1.3, drawstyle=style)
    most = (
        f"{short(float(values.max()))} ({name})"
        for name, (_, values) in curves.items()
        if len(values)
    )
    axes.set_title(plain(title.format(", ".join(most))), fontsize="medium", wrap=True)
    axes.set(xlabel=x, ylabel=y)
    if steps:
        axes.locator_params(axis="y", integer=True)
    axes.grid(alpha=0.3)
    axes.legend(axes.lines, [*map(plain, curves)], fontsize="small")
    return figure
