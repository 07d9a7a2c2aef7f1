"""Workspace of the twin pantograph: the poses of the handle at which no arm is at its stops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.device import pantograph
from hapticlink.components.device.motors_and_encoders import numbers
from hapticlink.components.specs.device import Device

Field = NDArray[np.float64]
POINTS, ANGLES = 81, 48
Range = tuple[float, float]


def margin(device: Device, poses: Field) -> Field:
    """Smallest distance (m) of an arm to its stops, shape (n,), at poses (x m, y m, theta rad) of
    shape (n, 3); negative outside the workspace."""
    pose = ca.SX.sym("pose", 3)
    least = ca.Function("margin", [pose], [ca.mmin(pantograph.margins(pose, numbers(device)))])
    given, margins = np.ascontiguousarray(poses, float), np.zeros(len(poses))
    buffer: Any
    buffer, evaluate = least.map(len(poses)).buffer()  # a plain call takes ten times as long
    buffer.set_arg(0, given.data)
    buffer.set_res(0, margins.data)
    evaluate()
    return margins


def link_function(device: Device) -> ca.Function:
    """The points of `links`, (2, 12), as a function of the pose, (3,)."""
    p, pose = numbers(device), ca.SX.sym("pose", 3)
    rows = []
    for arm in pantograph.arms(pose, p):
        elbow = arm.base + p["proximal_length"] * arm.proximal_direction
        rows += [arm.base, elbow, pose[:2] + arm.offset]
    return ca.Function("links", [pose], [ca.horzcat(*rows)])


def links(device: Device, pose: Sequence[float]) -> Field:
    """Base joint, elbow and crank end (x, y m) of the four arms at a pose, shape (4, 3, 2); the
    elbow is NaN where an arm does not reach."""
    return np.asarray(link_function(device)(ca.DM(list(pose)))).T.reshape(4, 3, 2)


@dataclass(frozen=True)
class Workspace:
    """Margins (m) on a grid of x, y (m) and theta (rad, a whole turn), shape (x, y, theta)."""

    x: Field
    y: Field
    theta: Field
    margin: Field

    @property
    def some(self) -> Field:
        """Largest margin over theta, shape (x, y): not negative where some theta is reachable."""
        return np.asarray(self.margin.max(axis=2))

    @property
    def every(self) -> Field:
        """Smallest margin over theta, shape (x, y): not negative where every theta is reachable."""
        return np.asarray(self.margin.min(axis=2))

    def extent(self, margin: Field) -> tuple[Range, Range] | None:
        """The smallest and the largest x and y (m) at which a margin of shape (x, y) is not
        negative, interpolated linearly between grid points; None if it is negative everywhere."""
        if margin.max() < 0:
            return None
        return _ends(self.x, margin.max(axis=1)), _ends(self.y, margin.max(axis=0))

    @property
    def turns(self) -> list[Range]:
        """The ranges of theta (rad) that are reachable at some position, to one grid step."""
        inside = np.flatnonzero((self.margin >= 0).any(axis=(0, 1)))
        runs = np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1)
        return [(float(self.theta[run[0]]), float(self.theta[run[-1]])) for run in runs if run.size]


def workspace(device: Device) -> Workspace:
    """The workspace on a grid over the common reach of the four arms."""
    reach = device.reach_limit * (device.proximal_length + device.distal_length) + device.crank / 2
    across = abs(reach - device.base_half_width)
    x = device.base_x + np.linspace(-across, across, POINTS)
    y = np.linspace(device.base_y_b - reach, device.base_y_a + reach, POINTS)
    theta = np.linspace(-math.pi, math.pi, ANGLES + 1)
    poses = np.stack(np.meshgrid(x, y, theta, indexing="ij"), axis=-1)
    return Workspace(x, y, theta, margin(device, poses.reshape(-1, 3)).reshape(poses.shape[:3]))


def _ends(grid: Field, margin: Field) -> Range:
    """The first and the last coordinate at which the margin, interpolated, is not negative."""
    inside = np.flatnonzero(margin >= 0)
    ends = []
    for last, beyond in ((inside[0], inside[0] - 1), (inside[-1], inside[-1] + 1)):
        if not 0 <= beyond < len(grid):
            ends.append(float(grid[last]))
            continue
        share = margin[last] / (margin[last] - margin[beyond])
        ends.append(float(grid[last] + share * (grid[beyond] - grid[last])))
    return ends[0], ends[1]
