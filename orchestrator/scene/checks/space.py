"""Checks a linkage in space: its types, axes and inertias, and what is of the plane alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import get_args

import numpy as np

from hapticlink.components.specs.control import Teleoperation
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.hand import ArmHand
from hapticlink.components.specs.joint_types import JOINT_TYPES, CutType, TreeType
from hapticlink.components.specs.linkage import Joint, Linkage, Loop
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem, path_of_user

PARALLEL = 1e-9
"""Sine of the angle between two axes below which they are one."""
_ARM, _COUPLING = ArmHand(target=()), Teleoperation()
ON_JOINTS = ("stiffness", "rest", "damping", "friction", "limits", "drive")
"""Keys that act on the coordinate of a joint."""
TURNED_ROUND = 1e-9
"""The share of the largest moment of inertia by which it may exceed the sum of the others."""


def check_space(scene: Scene) -> Iterator[Problem]:
    if scene.linkage is None:
        return
    for user, device in scene.all_devices.items():
        if device.space != scene.linkage.space:
            yield path_of_user("device", user), _misfit(scene.linkage, device)
    if scene.linkage.dimension > 2:
        yield from _of_the_plane(scene, scene.linkage)
        yield from check_joints_and_inertias(scene.linkage)


def _misfit(linkage: Linkage, device: Device) -> str:
    """What is wrong with a device and a linkage of which one is of the plane."""
    spatial = linkage.spatial or device.linkage.spatial
    if linkage.spatial:
        remedy = 'take one in space, extends = "ideal-3", or take it out'
        return f"is of the plane, and {spatial} put the linkage in space: {remedy}"
    return f"is in space, by {spatial}, and the linkage is of the plane: take a planar one"


def check_joints_and_inertias(linkage: Linkage) -> Iterator[Problem]:
    """Problems of a linkage in space."""
    kinds: tuple[tuple[str, Sequence[Joint | Loop], object], ...] = (
        ("joint", linkage.joint, TreeType),
        ("loop", linkage.loop, CutType),
    )
    for table, joints, types in kinds:
        able = [name for name in get_args(types) if JOINT_TYPES[name].in_space]
        for i, joint in enumerate(joints):
            path: Path = ("linkage", table, i)
            if not joint.kind.in_space:
                wanted = ", ".join(able)
                yield (*path, "type"), f"a {joint.type} joint is of the plane: take one of {wanted}"
            else:
                yield from _axes(path, joint)
    for i, body in enumerate(linkage.body):
        yield from _inertia(("linkage", "body", i, "inertia"), body.moments)


def _axes(path: Path, joint: Joint | Loop) -> Iterator[Problem]:
    """Problems of the axes of a joint, and of what is of the plane."""
    needed = joint.kind.axes
    kind = f"a {joint.type} joint"
    if joint.axis is not None and not isinstance(joint.axis, tuple):
        key = "axis" if isinstance(joint, Joint) else "axes"
        text = "an angle is of the plane: give three numbers"
        yield (*path, "axis"), f"{text} as {key}"
        return
    if isinstance(joint, Loop):
        given: list[tuple[Path, tuple[float, ...] | None]] = [
            ((*path, "axes", k), axis) for k, axis in enumerate(joint.axes or (None, None))
        ]
        wanted, is_given = "`axes`", joint.axes is not None
        if joint.angle is not None:
            yield (*path, "angle"), "is of the plane: in space the frames become parallel"
        for key in ON_JOINTS:
            if getattr(joint, key) is not None:
                text = "acts on a joint of the tree in space: cut the loop at another joint"
                yield (*path, key), text
    else:
        given = [((*path, "axis"), joint.axis), ((*path, "second_axis"), joint.second_axis)]
        wanted, is_given = "`axis` and `second_axis`", None not in (joint.axis, joint.second_axis)
        if needed < 2 and joint.second_axis is not None:
            yield (*path, "second_axis"), f"{kind} has no second axis: take it out"
    for place, axis in given:
        if axis is not None and not needed:
            yield place, f"{kind} has no axis: take it out"
        elif axis is not None and not np.linalg.norm(axis) > 0:
            yield place, f"{list(axis)} has no length: give a direction"
    if needed == 2 and not is_given:
        yield path, f"{kind} needs both its axes: give {wanted}"
    elif needed == 2 and isinstance(joint, Joint):
        first, second = (np.array(axis, float) for _, axis in given)
        lengths = np.linalg.norm(first) * np.linalg.norm(second)
        if lengths > 0 and np.linalg.norm(np.cross(first, second)) <= PARALLEL * lengths:
            yield (
                (*path, "second_axis"),
                "is parallel to `axis`: give two directions",
            )


def _inertia(path: Path, moments: tuple[float, ...]) -> Iterator[Problem]:
    """Problems of principal moments that no distribution of mass has."""
    if moments[0] < 0 or (moments[-1] > sum(moments[:-1]) * (1 + TURNED_ROUND) and moments[1:]):
        found = ", ".join(f"{moment:.6g}" for moment in moments)
        yield (
            path,
            f"no body has the principal moments {found}: each is at most the sum of the two others",
        )


def _defaults(here: Path, given: object, default: ArmHand | Teleoperation) -> Iterator[Problem]:
    """Problems of a record with gains by direction that the scene has not given."""
    for key, value in vars(default).items() if isinstance(given, type(default)) else ():
        if isinstance(value, tuple) and value and getattr(given, key) == value:
            text = "the default is of the plane, with a moment: give three numbers for x, y, z"
            yield (*here, key), text


def _of_the_plane(scene: Scene, linkage: Linkage) -> Iterator[Problem]:
    """What a scene with a linkage in space cannot have."""
    for user, hand in scene.all_hands.items():
        yield from _defaults(path_of_user("hand", user), hand, _ARM)
    for user, controller in scene.all_controllers.items():
        table = path_of_user("controller", user if user in scene.controllers else "")
        yield from _defaults((*table, "teleoperation"), controller.teleoperation, _COUPLING)
    if scene.contacts:
        text = f"are of the plane, and {linkage.spatial} put the linkage in space"
        yield ("contacts",), f"{text}: take the table out"
    if scene.local_model:
        yield ("local_model",), "is of the plane: leave it out"
    if linkage.points:
        yield ("linkage", "points"), "in space the hand holds one point: give `operational_point`"
    if scene.graphics and scene.graphics.sync != "exact":
        yield ("graphics", "sync"), "a copy in space follows the coordinates: take 'exact'"
    for i, body in enumerate(linkage.body):
        for key in ("radius", "corners"):
            if getattr(body, key) is not None:
                text = "is a shape of the plane, and in space nothing touches: take it out"
                yield ("linkage", "body", i, key), text
