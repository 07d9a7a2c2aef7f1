"""Figures of a haptic run, which `run` saves beside its tables.

Names: operational point x_S (of the mechanism), handle x_D (of the device).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import cycle, product
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.analysis.findings import labels, summary
from hapticlink.analysis.findings.episodes import Episode, episodes
from hapticlink.analysis.findings.forces import WRENCHES, touching, wrenches
from hapticlink.analysis.findings.tracking import (
    constraint_counts,
    count_constrained,
    find_handle,
    find_users,
    newest,
    of_block,
    of_port,
    pose_error,
    space_of,
)
from hapticlink.analysis.findings.user_port import UserPort, tolerated_energy, user_port
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.signal_names import (
    ENVIRONMENT_WRENCH,
    HAND_WRENCH,
    HANDLE_POSE,
    JOINT_COORDINATES,
    POINT_POSE,
    signal_of_user,
)
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results, Vector, with_record
from hapticlink.orchestrator.results.recorded_scene import described_devices, scene_part
from hapticlink.visualization import figure_axes
from hapticlink.visualization.curve_colours import CURVES
from hapticlink.visualization.figure_axes import (
    headline,
    in_lines,
    plain,
    set_margins,
    titled_axes,
)
from hapticlink.visualization.figure_files import encode
from hapticlink.visualization.figures.curves import curve, port_curve
from hapticlink.visualization.figures.force_figure import STYLES, forces
from hapticlink.visualization.figures.real_time_figure import real_time
from hapticlink.visualization.mechanism import drawing, marks
from hapticlink.visualization.mechanism.mark_places import MM, on_page
from hapticlink.visualization.mechanism.view import view_of_run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BESIDE = 2.9
"""Width (in) beside the drawing of the mechanism, of the whole device and the legend."""
ARROW = 50.0
"""Length (pt) of the arrow of the hand's force."""
DRAWN = 0.02
"""Of the largest energy at the user's port, above which a block's is drawn."""
SOURCES = {
    "shaping": "shaping of the device's inertia",
    "drift": "virtual coupling, F_drift",
    "topology": "topology controller, F_T",
    "environment": WRENCHES[ENVIRONMENT_WRENCH],
}
"""The blocks of `port_blocks.py` that are no hold, as a reader knows them."""


def figures(results: Results) -> dict[str, Figure]:
    """Figures of a run by name, as far as it has the signals; none before its first step."""
    return {name: draw() for name, draw in drawings(results).items()}


def drawings(results: Results) -> dict[str, Callable[[], Figure]]:
    """By name, what draws each figure of a run."""
    drawn_by: dict[str, Callable[[], Figure]] = {}
    if not results.last_time:
        return drawn_by
    with_rows = {name: table for name, table in results.tables.items() if len(table.rows)}
    whole_run = Results(results.folder, results.run, with_rows)
    results = with_record(whole_run, results.record, results.known_scene)
    whole, forced, touched = user_port(results), any(wrenches(results)), touching(results)
    counted = count_constrained(results)
    # an SSP has the block, but not its description
    linkage, devices = scene_part(results, "linkage", Linkage), described_devices(results)
    size, port = len(linkage.coordinate_units) if linkage else 0, whole and port_curve(whole)
    if of_port(results, POINT_POSE):
        table = of_block(results, JOINT_COORDINATES, size) if linkage else None
        q = table[JOINT_COORDINATES] if table else np.zeros((0, 1))
        finite = np.flatnonzero(np.isfinite(q).all(axis=1))
        if linkage and len(finite):
            drawn_by["mechanism"] = partial(_mechanism, results, linkage, q[finite[[0, -1]]], port)
        if linkage and linkage.dimension > 2:
            drawn_by["trajectories"] = partial(_places_in_time, results, linkage)
        elif "mechanism" not in drawn_by:
            drawn_by["trajectories"] = partial(_trajectories, results)
        if of_port(results, find_handle(results)):
            drawn_by["distance"] = partial(_distance, results)
    if forced:
        drawn_by["forces"] = partial(forces, results, devices)
    if touched:
        drawn_by["contact"] = partial(_contact, results, *touched)
    if counted:
        drawn_by["constraints"] = partial(_constraints, results, *counted)
    if port:
        drawn_by["user_port"] = partial(_port, results, port)
    if (paced := results.record.real_time) and paced["ticks"]:
        drawn_by["real_time"] = partial(real_time, results)
    return drawn_by


def files(results: Results, formats: Sequence[str]) -> Iterator[tuple[str, bytes]]:
    """Name and content of each file of the figures of a run, each drawn when it is asked for."""
    for name, draw in drawings(results).items():
        figure = draw()
        for kind in formats:
            yield f"{name}.{kind}", encode(figure, kind)


def _mechanism(results: Results, linkage: Linkage, q: Vector, port: UserPort | None) -> Figure:
    marked = episodes(results)
    figure, axes = titled_axes(results, _finding(results, marked, port), "", "")
    contacts, devices = scene_part(results, "contacts", Contacts), described_devices(results)
    starts: list[Vector] = []
    ends: list[Vector] = []
    for (label, style, path), colour in zip(_paths(results), cycle(CURVES)):
        axes.plot(*path.T, style, color=colour, lw=1.1, label=plain(f"path of {label}"))
        starts.append(path[0])
        ends.append(path[-1])
    square: Any = {"marker": "s", "ls": "", "color": "k", "ms": 5, "zorder": 7}
    axes.plot(*np.transpose(starts), mfc="w", label="start of a path", **square)
    axes.plot(*np.transpose(ends), label="end of a path", **square)
    _mark(results, marked, axes)
    _arrow(results, axes)
    limits = drawing.draw(axes, linkage, q[0], q[-1], contacts, devices.get(""))
    figure.set_size_inches(9.4, 6.4)
    set_margins(figure, right=BESIDE)
    headline(axes, axes.get_title().replace("\n", " "), 100, x=0, y=1.0, pad=12, ha="left")
    whole = figure.add_axes((1 - BESIDE / 9.4 + 0.01, 0.5, BESIDE / 9.4 - 0.03, 0.34))
    if devices:
        drawing.device(whole, linkage, q[0], devices, limits)
    else:
        whole.remove()
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles, labels, fontsize="x-small", ncols=1, frameon=False, alignment="left",
        loc="upper left", bbox_to_anchor=(1 - BESIDE / 9.4 + 0.005, 0.46 if devices else 0.88),
    )  # fmt: skip
    return figure


def _finding(results: Results, marked: Sequence[Episode], port: UserPort | None) -> str:
    """The tracking error, how far the operational point moved, how often the number of constrained
    directions was unusual, and what the rendering generated."""
    parts = [f"motion of the operational point up to {short(_reach(results))} mm from its start"]
    if of_port(results, find_handle(results)):
        time, apart, _ = pose_error(results)
        at = short(float(time[apart.argmax()]))
        parts.insert(0, f"tracking error up to {short(apart.max())} mm, at {at} s")
    if unusual := [e for e in marked if e.kind == "constraints"]:
        spans = f"{len(unusual)} intervals" if len(unusual) > 1 else "one interval"
        parts.append(f"unusual number of constrained directions in {spans}")
    if port and (found := port.measured).peak > tolerated_energy(found.hand_work):
        by = short(found.time_of_peak)
        parts.append(f"{short(1e3 * found.peak)} mJ generated by {by} s")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}"


def _reach(results: Results) -> float:
    """How far (mm) the operational point, or the handle without it, was from its start."""
    signal = POINT_POSE if of_port(results, POINT_POSE) else find_handle(results)
    _, path = _place(results, signal)
    return float(np.linalg.norm(path - path[0], axis=1).max(initial=0.0))


def _arrow(results: Results, axes: Axes) -> None:
    """The largest force of the hand, where it acted."""
    largest = _largest(results)
    if largest is None or not largest[0] > 0:
        return
    size, time, force, pose = largest
    _, color, where = marks.FORCES["F_hand"]
    label = in_lines(f"largest force of the hand, {short(size)} N, at {time:.3g} s", 34)
    place = (marks.Place((where,), (0.0,) * len(pose)),)
    arrow = marks.arrow("force", place, color, label, ("F_hand",))._replace(size=ARROW / size)
    frame = {where: pose.tolist(), "F_hand": force.tolist()}
    drawing.paint(axes, [arrow], frame, zorder=6, view=view_of_run(results))


def _largest(results: Results) -> tuple[float, float, Vector, Vector] | None:
    """The largest force of the hand (N), when (s), its components and where it acted (m)."""
    force, handle = of_port(results, HAND_WRENCH), of_port(results, find_handle(results))
    handle = handle or of_port(results, POINT_POSE)
    if not (force and handle):
        return None
    view = view_of_run(results)
    F, times = force[HAND_WRENCH][:, : view.dimension], force["time"]
    most = np.hypot.reduce(F, axis=1)
    k = int(most.argmax())
    pose = handle[HANDLE_POSE if HANDLE_POSE in handle else POINT_POSE][newest(handle, times[k])]
    return most[k], times[k], F[k], pose[: view.dimension]


def _mark(results: Results, marked: Sequence[Episode], axes: Axes) -> None:
    """The episodes of a run, along the path of the operational point."""
    if of_port(results, POINT_POSE) is None:
        return
    time, path = curve(*_place(results, POINT_POSE))
    path = on_page(path, view_of_run(results))
    for width, kind in enumerate(reversed({e.kind: None for e in marked}), 2):
        color, label = marks.KINDS[kind]
        spans = [(e.begin - 1e-12, e.end + 1e-12) for e in marked if e.kind == kind]
        parts = [path[slice(*np.searchsorted(time, span))] for span in spans]
        broken = np.vstack([rows for part in parts for rows in (part, [[np.nan, np.nan]])])
        axes.plot(
            *broken.T, color=color, label=label, lw=2 * width, alpha=0.5,
            solid_capstyle="butt", zorder=2.5 - 0.01 * width,
        )  # fmt: skip


def _place(results: Results, signal: str) -> tuple[Vector, Vector]:
    """Times (s) and places (mm) of a pose, (k, 2), in space (k, 3)."""
    table = of_port(results, signal)
    assert table is not None
    return table["time"], table[signal][:, : view_of_run(results).dimension] * MM


def _paths(results: Results) -> list[tuple[str, str, Vector]]:
    """Label, line style and path (mm, on the page) of operational point, handle and further
    points."""
    linkage = results.record.scene["linkage"] or {}
    further = [
        (signal_of_user(POINT_POSE, point["name"]), f"point {point['name']}", "-.")
        for point in linkage.get("point", ())
    ]
    return [
        (label, style, on_page(curve(*_place(results, signal))[1], view_of_run(results)))
        for signal, label, style in (
            (POINT_POSE, "operational point x_S", "-"),
            (find_handle(results), "handle x_D", "--"),
            *further,
        )
        if of_port(results, signal)
    ]


def _trajectories(results: Results) -> Figure:
    paths = _paths(results)
    if of_port(results, find_handle(results)):
        apart = short(pose_error(results).distance_mm.max())
        title = f"Handle and operational point at most {apart} mm apart"
    else:
        title = f"The operational point moves up to {short(_reach(results))} mm from its start"
    figure, axes = titled_axes(results, title, "x (mm)", "y (mm)")
    for label, style, path in paths:
        axes.plot(*path.T, style, label=plain(label))
    axes.plot(*np.array([path[0] for _, _, path in paths]).T, "k.", label="start")
    if contacts := scene_part(results, "contacts", Contacts):
        drawing.paint(axes, marks.obstacles(contacts), marks.STILL)
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(fontsize="small")
    return figure


def _places_in_time(results: Results, linkage: Linkage) -> Figure:
    """The operational point in space over time."""
    title = f"The operational point moves up to {short(_reach(results))} mm from its start"
    figure, axes = titled_axes(results, title, "time (s)", "place (mm)")
    time, drawn = curve(*_place(results, POINT_POSE))
    for name, column, style in zip(linkage.space.names, drawn.T, cycle(STYLES)):
        axes.plot(time, column, style, label=name)
    axes.legend(fontsize="small")
    return figure


def _distance(results: Results) -> Figure:
    users = {u.name: curve(*pose_error(results, u)) for u in find_users(results)}
    largest, (time, gap, _) = max(users.items(), key=lambda each: each[1][1].max(initial=0))
    at = int(gap.argmax())
    title = f"Handle at most {short(gap[at])} mm from {_point(largest)}, at {short(time[at])} s"
    figure, axes = titled_axes(results, title, "time (s)", "distance |x_S - x_D| (mm)")
    for (user, error), style in zip(users.items(), cycle(STYLES)):
        axes.plot(*error[:2], style, label=plain(_point(user)))
    if len(users) > 1:
        axes.legend(fontsize="small")
    return figure


def _point(user: str) -> str:
    return f"point {user}" if user else "the operational point"


def _contact(results: Results, times: Vector, pushes: NDArray[np.bool_]) -> Figure:
    table = of_port(results, ENVIRONMENT_WRENCH)
    assert table is not None
    share = 100 * float(pushes.sum() / len(pushes))
    size = table.by_row(lambda F: np.linalg.norm(F[:, :2], axis=1), ENVIRONMENT_WRENCH)
    time, force, pushing = curve(times, size, pushes)
    most = short(force[pushing].max(initial=0.0))
    title = f"Contacts push in {short(share)} % of the samples, with |F_env| of at most {most} N"
    figure, axes = titled_axes(
        results, title if share else "Nothing is touched", "time (s)", "|F_env| (N)"
    )
    axes.plot(time, force)
    return figure


def _constraints(results: Results, times: Vector, numbers: Vector) -> Figure:
    samples = constraint_counts(numbers)
    time, count = curve(times, numbers)
    most = int(count.max())
    share = 100 * (samples[max(samples)] / sum(samples.values()))
    title = f"{most} of 3 directions of motion constrained in {share:.3g} % of the samples"
    label = "constrained directions\n(a wrench along one accelerates hardly anything)"
    figure, axes = titled_axes(results, title, "time (s)", label)
    set_margins(figure, right=0.7)
    axes.step(time, count, where="post")
    if most < 10:
        axes.set(yticks=range(max(most, 3) + 1), ylim=(-0.15, max(most, 3) + 0.15))
    third = "rotation" if any(space_of(results).turns) else "z"
    free = axes.secondary_yaxis("right", functions=(lambda n: 3 - n,) * 2)  # its own inverse
    free.set(yticks=range(4), ylabel=f"directions free to move, of x, y and {third}")
    return figure


def _source(block: str) -> str:
    """A block of `port_blocks.py` as a reader knows it."""
    _, hold, of = block.rpartition("hold of ")
    if hold:
        signal, on, where = of.partition(" on ")
        user, colon, words = labels.signal(signal).rpartition(": ")
        return f"{user}{colon}hold of the {words}{on}{where}"
    return SOURCES.get(block, block)


def _port(results: Results, port: UserPort) -> Figure:
    measured = port.measured
    peak, at = measured.peak, int(np.argmax(port.generated_J))
    whose = summary.name_hands(measured)
    title = f"The rendering {summary.describe_generated(peak, measured.generated)}"
    if peak > summary.ROUNDING_J:
        title = f"At most {short(1e3 * peak)} mJ generated, at {port.time_s[at]:.3g} s"
        if put_in := float(port.put_in_J[at]):
            title += f", where {whose} had {summary.describe_work(1e3 * put_in, 'taken')}"
    if peak > summary.ROUNDING_J and port.blocks_J:
        largest = max(port.blocks_J, key=lambda name: float(port.blocks_J[name][at]))
        title += f"; largest source then: {_source(largest)}"
    figure, axes = titled_axes(results, title, "time (s)", "energy at the user's port (mJ)")
    axes.plot(port.time_s, 1e3 * port.generated_J, "k", lw=1.8, label="generated in all")
    axes.plot(port.time_s, 1e3 * port.put_in_J, "k:", lw=1.2, label=f"put in by {whose}")
    least = DRAWN * np.abs(port.generated_J).max()
    drawn = {name: e for name, e in port.blocks_J.items() if np.abs(e).max() > least}
    looks = product(("-", "-."), CURVES)
    for (name, energy), (dash, colour) in zip(drawn.items(), cycle(looks)):
        source = plain(fill(_source(name), 32))
        axes.plot(port.time_s, 1e3 * energy, dash, color=colour, lw=1.2, label=source)
    most = 1e3 * tolerated_energy(port.hand_work_J)
    axes.axhline(most, color="k", ls="--", lw=0.8, label=f"tolerated: {short(most)} mJ")
    low, high = axes.get_ylim()
    axes.axhspan(min(low, 0), 0, color="#228833", alpha=0.06, lw=0, label="passive: 0 or less")
    axes.set_ylim(min(low, 0), high)
    axes.axhline(0, color="0.4", lw=0.8)
    figure_axes.legend_below(figure)
    return figure
