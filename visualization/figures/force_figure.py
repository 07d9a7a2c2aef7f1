"""The figure of the forces, moments and motor torques of a haptic run over time."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import TYPE_CHECKING, Any

from hapticlink.analysis.findings.forces import (
    WRENCHES,
    motor_loads,
    torque_limits,
    torques,
    wrenches,
)
from hapticlink.analysis.findings.tracking import UserSignals, find_users, space_of
from hapticlink.components.specs.device import Device
from hapticlink.orchestrator.results.numbers import short
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.visualization.curve_colours import CURVES
from hapticlink.visualization.figure_axes import legend_above_curves, titled_axes
from hapticlink.visualization.figures.curves import curve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLES = ("-", "--", ":", "-.")


def forces(results: Results, devices: Mapping[str, Device]) -> Figure:
    """Forces, moments and, against their limits, motor torques of a run that has wrenches.
    devices: of each user by point; the first one's name is empty. Further users are dashed."""
    drawn = {name: curve(*each) for name, *each in wrenches(results)}
    driven = {
        user: curve(time, *tau)
        for user, device in devices.items()
        for time, tau in [torques(results, device, UserSignals.of(user)) or (None, ())]
        if time is not None
    }
    largest, (_, force, _) = max(drawn.items(), key=lambda item: item[1][1].max())
    title = f"The largest force is that of the {largest}: {short(force.max())} N"
    labels = ["force (N)", "moment (N.m)"][: 1 + any(space_of(results).turns)]
    of_wrenches = len(labels)
    labels += ["motor torque (N.m)"] if driven else []
    limits = {
        user: torque_limits(results, device, UserSignals.of(user))
        for user, device in devices.items()
    }
    loads = [
        load.max(initial=0.0)
        for user, device in devices.items()
        for _, load in [motor_loads(results, device, UserSignals.of(user)) or (None, None)]
        if load is not None
    ]
    if loads:
        title += f"; motors reach {short(100 * max(loads))} % of their torque limit"
    figure, _ = titled_axes(results, title, "time (s)", *labels)
    axes = figure.axes
    styles = dict(zip([user.name for user in find_users(results)], cycle(STYLES)))
    names = [*WRENCHES.values()]
    for name, (time, *force_and_moment) in drawn.items():
        user, _, kind = name.rpartition(": ")
        look: dict[str, Any] = {"lw": 1, "color": CURVES[names.index(kind)], "ls": styles[user]}
        for panel, values in zip(axes[:of_wrenches], force_and_moment, strict=False):
            panel.plot(time, values, label=name, **look)
    for panel in axes[:of_wrenches]:
        legend_above_curves(panel, columns=2)
    for user, (time, *tau) in driven.items():
        for i, each in enumerate(tau):
            label = None if user else f"motor {i + 1}"
            axes[-1].plot(time, each, lw=1, color=CURVES[i], ls=styles[user], label=label)
        known = limits[user]
        ends = () if known is None else {sign * limit for limit in known for sign in (-1, 1)}
        for end in sorted(ends):
            label = None if user or end != max(ends) else "limit"
            axes[-1].axhline(end, color="k", lw=0.8, ls="--", label=label)
    if driven:
        legend_above_curves(axes[-1], columns=5)
    return figure
