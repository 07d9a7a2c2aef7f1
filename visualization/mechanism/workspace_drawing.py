"""The workspace of a scene's device, as text and as a drawing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hapticlink.components.device.workspace import Field, links, margin, workspace
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
    shades = (
        (space.some, "0.92", "handle at some theta"),
        (space.every, "0.8", "handle at every theta"),
    )
    for field, shade, _ in shades:
        axes.contourf(space.x, space.y, field.T, [0, math.inf], colors=[shade])
    for i, arm in enumerate(links(device, start)):
        color, label = (("C0", "arms of plane A"), ("C1", "arms of plane B"))[i // 2]
        axes.plot(*arm.T, color=color, marker="o", ms=3, label=label if i % 2 == 0 else None)
        motor = "motors" if i == 0 else None
        axes.plot(*arm[0], color=color, marker="s", ls="", label=motor)
    ends = links(device, start)[[0, 2], 2]
    axes.plot(*ends.T, "k-", lw=3, label="crank")
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
    poses = np.stack(np.meshgrid(x / 1e3, y / 1e3, theta, indexing="ij"), axis=-1)
    most = margin(device, poses.reshape(-1, 3)).reshape(poses.shape[:3]).max(axis=2)
    if most.min() < 0:
        axes.contourf(x, y, most.T, [-math.inf, 0], colors=[BEYOND], zorder=-1)
        axes.plot([], [], "s", color=BEYOND, ms=9, label="outside the device's workspace")
