"""Workspace of a device: the poses of its handle at which it is at none of its stops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.device.models import device_model
from hapticlink.components.evaluate_rows import evaluate_rows
from hapticlink.components.linkage.parameters import distance
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.quantities import Place

Field = NDArray[np.float64]
POINTS, ANGLES = 81, 48
Range = tuple[float, float]


def margin(device: Device, poses: Field) -> Field:
    """Smallest distance (m) of the device to its stops, shape (n,), at poses (x m, y m, theta rad)
    of shape (n, 3); negative outside the workspace, and where no place of its joints is found."""
    margins = evaluate_rows(_margin_function(device), poses)[:, 0]
    return np.where(np.isfinite(margins), margins, -np.inf)


@cache
def _margin_function(device: Device) -> ca.Function:
    pose = ca.SX.sym("pose", 3)
    return ca.Function("margin", [pose], [device_model(device).margin_at(pose)], {"cse": True})


@cache
def line_function(device: Device) -> ca.Function:
    """The lines of `lines`, (d, points), end to end, as a function of the pose, (3,)."""
    model, pose = device_model(device), ca.SX.sym("pose", 3)
    frames = model.frames(model.place_at_pose(pose), model.numbers)
    points = [
        frames[body].point(None if at is None else _local(device, at))
        for line in drawn_lines(device)
        for body, at in line
    ]
    return ca.Function("lines", [pose], [ca.horzcat(*points)], {"cse": True})


@cache
def drawn_lines(device: Device) -> tuple[tuple[tuple[str, Any], ...], ...]:
    """The device as lines: of each body its pins and, where that is on it, the handle, in their
    order along it; and from the ground to what slides on it."""
    at: dict[str, list[Any]] = {body.name: [] for body in device.body}
    joined = [(j.child, j.at_child) for j in device.placed]
    joined += [(j.parent, j.at_parent) for j in device.placed if j.type == "revolute"]
    joined += [end for c in device.placed_loops for end in zip(c.bodies, c.at, strict=True)]
    for body, point in [*joined, (device.handle.body, device.handle.at)]:
        if body in at and (point or (0.0, 0.0)) not in at[body]:
            at[body].append(point or (0.0, 0.0))
    lines = [tuple((body, point) for point in _in_order(points)) for body, points in at.items()]
    for j in device.placed:
        if j.type == "prismatic":
            lines.append(((j.parent, j.at_parent), (j.child, j.at_child)))
    return tuple(line for line in lines if len(line) > 1)


def _local(device: Device, at: Place) -> ca.SX:
    """A point of a body with as many numbers as the device has dimensions."""
    return ca.SX(ca.DM([*at, 0.0][: device.linkage.dimension]))


def _in_order(points: list[Any]) -> list[Any]:
    """Points of a body along it: from one of the two farthest ones on."""
    far = max(points, key=lambda p: max(distance(p, q) for q in points))
    return sorted(points, key=lambda p: distance(p, far))


def lines(device: Device, pose: Sequence[float]) -> list[Field]:
    """The device at a pose as lines of points (m), each (points, d)."""
    points = np.asarray(line_function(device)(ca.DM(list(pose)))).T
    ends = np.cumsum([len(line) for line in drawn_lines(device)])
    return np.split(points, ends[:-1])


def motor_points(device: Device, pose: Sequence[float]) -> Field:
    """Where the motors are (m) at a pose, (m, d)."""
    model, at = device_model(device), ca.SX.sym("pose", 3)
    frames = model.frames(model.place_at_pose(at), model.numbers)
    joints = [motor.joint for motor in model.motors]
    points = [frames[j.parent].point(_local(device, j.at_parent or (0.0, 0.0))) for j in joints]
    found = ca.Function("motors", [at], [ca.horzcat(*points)])(ca.DM(list(pose)))
    return np.asarray(found).T


@dataclass(frozen=True)
class Workspace:
    """Margins (m) on a grid of x, y (m) and theta (rad, a whole turn, or one angle of a device that
    has no turn to be felt), shape (x, y, theta)."""

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


@cache
def workspace(device: Device) -> Workspace:
    """The workspace on a grid: a coarse one over all that the lengths of the device's links could
    reach, then a fine one over what of it is inside, and hangs together with the start."""
    model = device_model(device)
    center, reach = _reach(device)
    whole = 2 * math.pi if model.directions.has_moments else 0.0
    coarse, fine = (
        np.linspace(-whole / 2, whole / 2, count + 1 if whole else 1)
        for count in (ANGLES // 4, ANGLES)
    )
    theta = model.start_pose[2:] if not whole else coarse
    x, y = (c + np.linspace(-reach, reach, POINTS // 2) for c in center)
    found = _on_grid(device, x, y, theta)
    inside = found.some >= 0
    if not inside.any():
        return found
    x, y = (_around(side, inside.any(axis=1 - i)) for i, side in enumerate((x, y)))
    return _on_grid(device, x, y, theta if not whole else fine)


def _around(side: Field, inside: Any) -> Field:
    """A finer grid over the part of a coarse one that is inside."""
    (at,) = np.nonzero(inside)
    return np.linspace(side[max(at[0] - 1, 0)], side[min(at[-1] + 1, len(side) - 1)], POINTS)


def _on_grid(device: Device, x: Field, y: Field, theta: Field) -> Workspace:
    from scipy.ndimage import label  # slow to load

    poses = np.stack(np.meshgrid(x, y, theta, indexing="ij"), axis=-1)
    margins = margin(device, poses.reshape(-1, 3)).reshape(poses.shape[:3])
    start = device_model(device).start_pose
    parts, _ = label(margins >= 0)
    nearest = [
        int(np.abs(axis - at).argmin()) for axis, at in zip((x, y, theta), start, strict=True)
    ]
    if own := parts[tuple(nearest)]:
        margins = np.where((margins < 0) | (parts == own), margins, -np.inf)
    return Workspace(x, y, theta, margins)


_HERE = (0.0, 0.0)


def _reach(device: Device) -> tuple[Field, float]:
    """The ground's joint (m) from which joints of the tree lead to the handle, and the sum (m) of
    all lengths on the way; of a slide without a range, of all lengths of the device."""
    above, body, point = {j.child: j for j in device.placed}, device.handle.body, device.handle.at
    reach = 0.0
    while True:
        joint = above[body]
        reach += distance(point or (0.0, 0.0), joint.at_child or (0.0, 0.0))
        if joint.type == "prismatic":
            every = (distance(j.at_parent or _HERE, _HERE) for j in device.joint)
            reach += max(map(abs, joint.range)) if joint.range else sum(every)
        body, point = joint.parent, joint.at_parent
        if body == "ground":
            return np.array(point or (0.0, 0.0)), max(reach, 1e-3)


def extents_along(device: Device) -> list[Range | None]:
    """The first and the last coordinate (m) along each direction that the device renders, the
    others as at its start, between the points of a coarse grid sought once more; None where the
    start is outside of the workspace."""
    model, (_, reach) = device_model(device), _reach(device)
    start, found = model.start_pose, list[Range | None]()
    coarse = np.linspace(0.0, reach, POINTS // 2 + 1)
    inside = margin(device, start[None])[0] >= 0
    for along in np.array(model.directions.rows):
        ends = []
        for way in (-along, along):
            last = 0.0
            for ahead in (coarse, coarse[1] * np.linspace(0.0, 1.0, POINTS)):
                out = np.flatnonzero(margin(device, start + np.outer(last + ahead, way)) < 0)
                last += ahead[max(out[0] - 1, 0) if out.size else -1]
            ends.append(float(along @ (start + last * way)))
        found.append((ends[0], ends[1]) if inside else None)
    return found


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
