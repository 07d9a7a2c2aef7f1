"""Quick figures of a haptic run, made by `run` beside its tables.

Names: operational point x_S (of the mechanism), handle x_D (of the device).
"""

from __future__ import annotations

from textwrap import fill
from typing import Any

import numpy as np

from hapticlink.orchestrator.results.tables import Results, Table, Vector
from hapticlink.orchestrator.results.tracking import DEVICE, MECHANISM, table_of, tracking

CONTACT = "virtual_mechanism.F_env"
_ENDS = {"stop_when": "stop_when ended the run", "interrupted": "the run was interrupted"}


def draw(results: Results) -> list[str]:
    """Write what the run has signals for, and give the file names."""
    drawn = []
    if table_of(results, MECHANISM):
        drawn.append(_trajectories(results))
        if table_of(results, DEVICE):
            drawn.append(_distance(results))
    if contact := table_of(results, CONTACT):
        drawn.append(_contact(results, contact))
    counting = next((t for t in results.tables.values() if _count(t)), None)
    if counting:
        drawn.append(_constraints(results, counting))
    if made := _made(results):
        drawn.append(_energies(results, made))
    return drawn


def short(value: float) -> str:
    """Three digits, and no power of ten for what is neither very large nor very small."""
    if value and not 1e-3 <= abs(value) < 1e6:
        return f"{value:.3g}"
    return np.format_float_positional(value, precision=3, fractional=False, trim="-")


def _axes(results: Results, title: str, x: str, y: str) -> tuple[Any, Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    end = results.run["end"]
    if end["reason"] != "duration":
        why = _ENDS.get(end["reason"], "the run was lost")
        title += f", until {why} at {short(end['time'])} s"
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set(xlabel=x, ylabel=y)
    axes.set_title(fill(title, 70), fontsize="medium")
    axes.grid(alpha=0.3)
    return figure, axes


def _save(figure: Any, results: Results, name: str) -> str:
    figure.savefig(results.folder / name, dpi=150)
    return name


def _paths(results: Results) -> list[tuple[str, str, Vector]]:
    """(label, line, path in mm) of operational point, handle and further points."""
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


def _trajectories(results: Results) -> str:
    paths = _paths(results)
    if table_of(results, DEVICE):
        apart = short(tracking(results)[1].max())
        title = f"Handle and operational point part by at most {apart} mm"
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
    return _save(figure, results, "trajectories.png")


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


def _distance(results: Results) -> str:
    time, gap = tracking(results)
    at = int(gap.argmax())
    title = (
        f"Distance of handle to operational point: at most {short(gap[at])} mm, "
        f"at {short(time[at])} s"
    )
    figure, axes = _axes(results, title, "time (s)", "distance |x_S - x_D| (mm)")
    axes.plot(time, gap)
    return _save(figure, results, "distance.png")


def _contact(results: Results, table: Table) -> str:
    force = np.linalg.norm(table[CONTACT][:, :2], axis=1)
    share = 100 * float((force > 0).mean())
    title = f"Contacts push with at most {short(force.max())} N, in {short(share)} % of the samples"
    figure, axes = _axes(results, title, "time (s)", "|F_env| of the contacts (N)")
    axes.plot(table["time"], force)
    return _save(figure, results, "contact.png")


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
    figure, axes = _axes(results, title, "time (s)", "resisted directions")
    axes.step(time, count, where="post")
    axes.set_yticks(range(most + 2))
    return _save(figure, results, "constraints.png")


def _made(results: Results) -> dict[str, float]:
    """Energy (J) that the hold of each connection made, those across rates first."""
    across = results.run["energies"]
    booked = ({} if across == "none" else across) | results.run["energies_within_a_rate"]
    return {name: energy["made"] for name, energy in booked.items()}


def _energies(results: Results, made: dict[str, float]) -> str:
    total = sum(made.values())
    unit, per = ("mJ", 1e3) if max(map(abs, made.values())) < 0.1 else ("J", 1.0)
    did = "make" if total >= 0 else "lose"
    title = f"The holds {did} {short(abs(total) * per)} {unit} in all"
    figure, axes = _axes(results, title, f"energy made by the hold ({unit}; negative: lost)", "")
    values = [value * per for value in made.values()]
    bars = axes.barh([fill(name, 28) for name in made], values, height=0.5)
    axes.bar_label(bars, [short(value) for value in values], padding=3)
    axes.margins(x=0.35, y=0.2)
    axes.axvline(0, color="0.4", lw=0.8)
    axes.invert_yaxis()
    return _save(figure, results, "energies.png")
