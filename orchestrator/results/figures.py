"""Figures of a haptic run, which `run` saves beside its tables.

Names: operational point x_S (of the mechanism), handle x_D (of the device).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticlink.orchestrator.base import interrupt
from hapticlink.orchestrator.results.tables import Results, Table, Vector
from hapticlink.orchestrator.results.tracking import DEVICE, MECHANISM, table_of, tracking

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CONTACT = "virtual_mechanism.F_env"
_ENDS = {
    "stop_when": "stop_when ended the run",
    "terminated": "an FMU ended the run",
    "diverged": "the run diverged",
    "interrupted": "the run was interrupted",
    "running": "the last row so far",
}


def figures(results: Results) -> dict[str, Figure]:
    """Figures of a run by name, as far as it has the signals; none before its first step."""
    drawn: dict[str, Figure] = {}
    if not _last(results):
        return drawn
    if table_of(results, MECHANISM):
        drawn["trajectories"] = _trajectories(results)
        if table_of(results, DEVICE):
            drawn["distance"] = _distance(results)
    if contact := table_of(results, CONTACT):
        drawn["contact"] = _contact(results, contact)
    counting = next((t for t in results.tables.values() if _count(t)), None)
    if counting:
        drawn["constraints"] = _constraints(results, counting)
    if generated := _generated(results):
        drawn["energies"] = _energies(results, generated)
    return drawn


def save(figures: Mapping[str, Figure], folder: Path) -> list[str]:
    """Write each figure as a PNG; returns the file names. Raises Interrupted."""
    for name, figure in figures.items():
        interrupt.check()
        path = folder / f"{name}.png"
        path.unlink(missing_ok=True)  # a link is replaced, not followed
        figure.savefig(path, dpi=150)
    return [f"{name}.png" for name in figures]


def _last(results: Results) -> float:
    """The time (s) of the last row of the first table."""
    rows = next(iter(results.tables.values()))["time"]
    return float(rows[-1]) if len(rows) else 0.0


def short(value: float) -> str:
    """A number with three significant digits, with an exponent only if very large or small."""
    if value and not 1e-3 <= abs(value) < 1e6:
        return f"{value:.3g}"
    return np.format_float_positional(value, precision=3, fractional=False, trim="-")


def _axes(results: Results, title: str, x: str, y: str) -> tuple[Figure, Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    end = results.run["end"]
    if end["reason"] != "duration":
        why = _ENDS.get(end["reason"], "a fault ended the run")
        title += f", until {why} at {short(_last(results))} s"
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set(xlabel=x, ylabel=y)
    axes.set_title(fill(title, 70), fontsize="medium")
    axes.grid(alpha=0.3)
    return figure, axes


def _paths(results: Results) -> list[tuple[str, str, Vector]]:
    """Label, line style and path (mm) of operational point, handle and further points."""
    linkage = results.run["scene"]["linkage"] or {}
    further = [
        (f"virtual_mechanism.{point['name']}.x", f"point {point['name']}", "-.")
        for point in linkage.get("point", ())
    ]
    return [
        (label, style, table[signal][:, :2] * 1e3)
        for signal, label, style in (
            (MECHANISM, "operational point x_S", "-"),
            (DEVICE, "handle x_D", "--"),
            *further,
        )
        if (table := table_of(results, signal))
    ]


def _trajectories(results: Results) -> Figure:
    paths = _paths(results)
    if table_of(results, DEVICE):
        apart = short(tracking(results)[1].max())
        title = f"Handle and operational point at most {apart} mm apart"
    else:
        reach = np.linalg.norm(paths[0][2] - paths[0][2][0], axis=1).max()
        title = f"The operational point moves up to {short(reach)} mm from its start"
    figure, axes = _axes(results, title, "x (mm)", "y (mm)")
    for label, style, path in paths:
        axes.plot(*path.T, style, label=label)
    axes.plot(*np.array([path[0] for _, _, path in paths]).T, "k.", label="start")
    _obstacles(axes, results.run["scene"]["contacts"])
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(fontsize="small")
    return figure


def _obstacles(axes: Any, contacts: dict[str, Any] | None) -> None:
    from matplotlib.patches import Circle, Patch, Polygon

    if not contacts:
        return
    look: dict[str, Any] = {"facecolor": "0.85", "edgecolor": "0.4"}
    found: list[Patch] = [
        Circle(tuple(1e3 * x for x in d["center"]), d["radius"] * 1e3, **look)
        for d in contacts["disc"]
    ]
    found += [Polygon(np.array(p["corners"]) * 1e3, **look) for p in contacts["polygon"]]
    if contacts["enclosure"]:
        walls = np.array(contacts["enclosure"]) * 1e3
        found.append(Polygon(walls, fill=False, edgecolor="0.4", label="enclosure"))
    if contacts["disc"] or contacts["polygon"]:
        found[0].set_label("obstacles")
    for patch in found:
        axes.add_patch(patch)


def _distance(results: Results) -> Figure:
    time, gap = tracking(results)
    at = int(gap.argmax())
    title = (
        f"Distance of handle to operational point: at most {short(gap[at])} mm, "
        f"at {short(time[at])} s"
    )
    figure, axes = _axes(results, title, "time (s)", "distance |x_S - x_D| (mm)")
    axes.plot(time, gap)
    return figure


def _contact(results: Results, table: Table) -> Figure:
    force = np.linalg.norm(table[CONTACT][:, :2], axis=1)
    share = 100 * float((force > 0).mean())
    title = f"Contacts push with at most {short(force.max())} N, in {short(share)} % of the samples"
    figure, axes = _axes(results, title, "time (s)", "|F_env| of the contacts (N)")
    axes.plot(table["time"], force)
    return figure


def _count(table: Table) -> str | None:
    names = (c for c in table.columns if c.endswith(".n_constraints"))
    return next(names, None)


def _constraints(results: Results, table: Table) -> Figure:
    name = _count(table)
    assert name is not None
    count, time = table[name], table["time"]
    most = int(count.max())
    share = 100 * float((count == most).mean())
    title = f"{most} constrained directions in {share:.3g} % of the samples"
    figure, axes = _axes(results, title, "time (s)", "constrained directions")
    axes.step(time, count, where="post")
    axes.set_yticks(range(most + 2))
    return figure


def _generated(results: Results) -> dict[str, float]:
    """Energy (J) that the hold of each connection generated, connections across rates first."""
    across = results.run.get("energies", "none")  # a crash leaves none
    within = results.run.get("energies_within_a_rate", {})
    booked = ({} if across == "none" else across) | within
    return {name: energy["generated"] for name, energy in booked.items()}


def _energies(results: Results, generated: dict[str, float]) -> Figure:
    total = sum(generated.values())
    unit, per = ("mJ", 1e3) if max(map(abs, generated.values())) < 0.1 else ("J", 1.0)
    verb = "generate" if total >= 0 else "dissipate"
    title = f"The holds {verb} {short(abs(total) * per)} {unit} in all"
    label = f"energy generated by the hold ({unit}; negative: dissipated)"
    figure, axes = _axes(results, title, label, "")
    values = [value * per for value in generated.values()]
    bars = axes.barh([fill(name, 28) for name in generated], values, height=0.5)
    axes.bar_label(bars, [short(value) for value in values], padding=3)
    axes.margins(x=0.35, y=0.2)
    axes.axvline(0, color="0.4", lw=0.8)
    axes.invert_yaxis()
    return figure
