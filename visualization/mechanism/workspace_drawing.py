"""The workspace of a scene's device, as text and as a drawing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hapticlink.components.device.workspace import (
    Field,
    drawn_lines,
    lines,
    margin,
    motor_points,
    workspace,
)
from hapticlink.components.dynamics.rendered_directions import rendered_directions
from hapticlink.components.specs.device import Device
from hapticlink.visualization.figure_axes import headline

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEYOND = "#fbe3d6"
Pose = Sequence[float]
"""x m, y m, theta rad."""


def draw(device: Device, start: Pose, title: str) -> Figure:
    """A drawing of the device at the pose `start`, and of its workspace."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    space = workspace(device)
    figure = Figure(figsize=(6.4, 5.4), layout="constrained")
    axes = figure.add_subplot()
    turns = len(space.theta) > 1
    shades = [(space.some, "0.92", "handle at some theta" if turns else "handle")]
    shades += [(space.every, "0.8", "handle at every theta")] if turns else []
    for field, shade, _ in shades:
        if np.isfinite(field).any() and field.max() >= 0:
            shown = np.where(np.isfinite(field), field, -1.0)
            axes.contourf(space.x, space.y, shown.T, [0, math.inf], colors=[shade])
    drawn = lines(device, start)
    for line, places in zip(drawn, drawn_lines(device), strict=True):
        held = any(body == device.handle.body for body, _ in places)
        look: dict[str, Any] = {"color": "C0", "marker": "o", "ms": 3}
        look = {"color": "k", "lw": 3} if held else look
        text = "body of the handle" if held else "links"
        known = axes.get_legend_handles_labels()[1]
        axes.plot(*line.T, label=None if text in known else text, **look)
    for i, at in enumerate(motor_points(device, start)):
        axes.plot(*at, color="C0", marker="s", ls="", label=None if i else "motors")
    axes.plot(*start[:2], "wo", mec="k", label="handle where the scene starts")
    handles, labels = axes.get_legend_handles_labels()
    handles += [Patch(color=shade) for _, shade, _ in shades]
    labels += [text for _, _, text in shades]
    figure.legend(handles, labels, fontsize="small", ncols=3, loc="outside lower center")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_aspect("equal", adjustable="datalim")  # a box would cut the title of a tall one
    headline(axes, title, 70)
    axes.grid(alpha=0.3)
    return figure


def beneath(axes: Axes, device: Device, limits: Field) -> None:
    """A shade where the handle cannot be at any theta, within `limits` of x and y (mm), for a
    drawing in mm."""
    x, y = (np.linspace(low, high, 41) for low, high in limits)
    theta = np.linspace(-math.pi, math.pi, 16, endpoint=False)
    theta = theta if rendered_directions(device.handle).has_moments else theta[:1]
    poses = np.stack(np.meshgrid(x / 1e3, y / 1e3, theta, indexing="ij"), axis=-1)
    most = margin(device, poses.reshape(-1, 3)).reshape(poses.shape[:3]).max(axis=2)
    if most.min() < 0:
        shown = np.where(np.isfinite(most), most, -1.0)
        axes.contourf(x, y, shown.T, [-math.inf, 0], colors=[BEYOND], zorder=-1)
        axes.plot([], [], "s", color=BEYOND, ms=9, label="outside the device's workspace")
