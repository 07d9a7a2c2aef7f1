"""Poses of the workspace around the run of a scene: a grid of places of the operational point.

The places are the centres of equal cells of the rectangle that the run visits, widened by half a
mean link length to each side. The linkage is led to each from the nearest poses that are known, of
the run at first (inverse kinematics), so that its loops stay assembled as they are there and the
point turns as little as possible. Where the point can move along a curve only, the nearest pose
within the cell is taken. Left out is what linkage or device do not reach, what is beyond the limits
of a joint, and what is inside an obstacle.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hapticlink.analysis.findings.contact_warnings import PRESSED
from hapticlink.analysis.stability.poses import Pose, by_joint, visited_poses
from hapticlink.components.contact.depth import depths
from hapticlink.components.device.workspace import margin
from hapticlink.components.linkage.inverse_kinematics import InverseKinematics, Reached
from hapticlink.components.linkage.parameters import mean_link_length
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.results.read_results import Results
from hapticlink.orchestrator.scene.blocks import described_devices
from hapticlink.orchestrator.scene.scene import Scene

FROM, TRIED = 64, 4
"""Poses of the run from which the linkage is led on, and the nearest ones that are tried."""
CLOSED = 1e-9
"""Largest gap (m) of a closure, and distance (m) of the point from its place."""


def grid_poses(run: Results, read: Scene, linkage: Linkage, count: int) -> list[Pose]:
    """The poses at `count` times `count` places around a `run` of a scene, named by the place in
    mm; a scene without [device] has the reach of its linkage."""
    points, coordinates = visited_poses(run)
    widened = mean_link_length(linkage) / 2
    low, high = points[:, :2].min(axis=0) - widened, points[:, :2].max(axis=0) + widened
    cell = (high - low) / count
    x, y = (a + size * (np.arange(count) + 0.5) for a, size in zip(low, cell, strict=True))
    kinematics = InverseKinematics(linkage)
    known = [*zip(points[:, :2], coordinates, strict=True)][:: max(1, len(points) // FROM)]
    curve = kinematics.reached(coordinates[0], points[0, :2]).directions < 2
    left = [*np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)]
    poses: dict[str, Pose] = {}
    while True:
        reached = {}
        for i, place in enumerate(left):
            near = sorted(known, key=lambda pose: float(np.hypot(*(pose[0] - place))))
            for _, q in near[:TRIED]:
                there = kinematics.reached(q, place)
                off = np.abs(there.point[:2] - place)
                if there.gap <= CLOSED and (off <= (cell / 2 if curve else CLOSED)).all():
                    reached[i] = there
                    break
        known += [(there.point[:2], there.q) for there in reached.values()]
        for there in reached.values():
            if _is_allowed(read, linkage, there):
                pose = _pose(read, linkage, there)
                poses.setdefault(pose.name, pose)
        if not reached:
            return [*poses.values()]
        left = [place for i, place in enumerate(left) if i not in reached]


def _is_allowed(read: Scene, linkage: Linkage, reached: Reached) -> bool:
    """Whether the devices reach a pose, joints are within their limits, and nothing is inside an
    obstacle."""
    for user, device in described_devices(read).items():
        point = reached.further[user] if user else reached.point
        if margin(device, point[None])[0] < 0.0:
            return False
    if not all(lower <= q <= upper for q, lower, upper in _limits(linkage, reached.q)):
        return False
    if read.contacts is None:
        return True
    deepest = (float(depth[0]) for _, depth in depths(linkage, read.contacts, reached.q[None]))
    return max(deepest, default=0.0) <= PRESSED


def _limits(linkage: Linkage, q: Vector) -> Iterator[tuple[float, float, float]]:
    """The coordinate of each joint with limits, and these."""
    values = by_joint(linkage, q)
    for joint in linkage.joint:
        value = values[joint.name]
        if joint.limits and isinstance(value, float):
            lower, upper = joint.limits.lower, joint.limits.upper
            yield value, -np.inf if lower is None else lower, np.inf if upper is None else upper


def _pose(read: Scene, linkage: Linkage, reached: Reached) -> Pose:
    x, y = (round(1e3 * value, 2) + 0.0 for value in reached.point[:2].tolist())
    held = {user: tuple(reached.further[user].tolist()) for user in read.devices}
    return Pose(
        time=0.0,
        joints=by_joint(linkage, reached.q),
        point=tuple(reached.point.tolist()),
        press=(0.0, 0.0, 0.0),
        others=held,
        title=f"({x:g}, {y:g}) mm",
    )
