"""Checks the names of a linkage: a tree of joints, loops between bodies, points on bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import get_args

from hapticlink.components.specs.drives import ConstantDrive
from hapticlink.components.specs.joint_types import (
    ANGLE,
    AXIS,
    JOINT_TYPES,
    CutType,
    TreeType,
)
from hapticlink.components.specs.linkage import NO_POINT, Joint, Linkage, Loop
from hapticlink.orchestrator.base.errors import unknown
from hapticlink.orchestrator.scene.scene import Graphics, Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def check_linkage(linkage: Linkage, graphics: Graphics | None = None) -> Iterator[Problem]:
    here: Path = ("linkage",)
    frames = {"ground": -1}
    for i, body in enumerate(linkage.body):
        if body.name in frames:
            path: Path = (*here, "body", i, "name")
            yield path, f"{body.name!r} is taken: name each body once, none 'ground'"
        frames.setdefault(body.name, i)
    bodies = [name for name in frames if name != "ground"]
    yield from _tree(linkage, frames)
    for kind in ("loop", "spring"):
        for i, pair in enumerate(getattr(linkage, kind)):
            for k, name in enumerate(pair.bodies):
                if name not in frames:
                    yield (*here, kind, i, "bodies", k), unknown("body", name, frames)
            if kind == "loop" and pair.bodies[0] == pair.bodies[1]:
                yield (*here, kind, i, "bodies"), "a loop joins two different bodies"
    yield from _own_keys(linkage)
    yield from _gears(linkage)
    yield from _limits(linkage)
    yield from _choices(linkage, bodies)
    if linkage.choices and graphics and graphics.sync == "operational":
        message = "nothing pulls the copy while the hand holds no point: take 'exact' or 'joint'"
        yield ("graphics", "sync"), message
    joints = {j.name: j for j in linkage.joint}
    for table in ("start", "start_velocity"):
        for name, value in getattr(linkage, table).items():
            if (joint := joints.get(name)) is None:
                yield (*here, table, name), unknown("joint", name, joints)
            elif (len(value) if isinstance(value, tuple) else 1) != joint.kind.size:
                wanted = f"{joint.kind.count} number{'s' if joint.kind.size > 1 else ''}"
                yield (*here, table, name), f"{value!r}: a {joint.type} joint takes {wanted}"


def _choices(linkage: Linkage, bodies: Sequence[str]) -> Iterator[Problem]:
    """Problems of the operational point, and of those that it is chosen from."""
    here: Path = ("linkage", "operational_point")
    chosen, named = linkage.operational_point, linkage.points
    if not isinstance(chosen, str):
        if named:
            yield here, f"give one of linkage.points, which it is chosen from: {', '.join(named)}"
        if chosen.body not in bodies:
            yield (*here, "body"), unknown("body", chosen.body, bodies)
    elif chosen not in named:
        yield here, f"{unknown('point', chosen, named)}: add [linkage.points.{chosen}]"
    for name, point in named.items():
        path: Path = ("linkage", "points", name)
        if not name.isidentifier() or name == NO_POINT:
            yield path, f"{name!r}: a name of letters, digits and _, not {NO_POINT!r}"
        elif name in {each.name for each in linkage.point}:
            yield path, f"{name!r} is taken by [[linkage.point]]: name each point once"
        if point.body not in bodies:
            yield (*path, "body"), unknown("body", point.body, bodies)


def _own_keys(linkage: Linkage) -> Iterator[Problem]:
    """Problems of keys that a type of joint needs, or does not have."""
    tables: dict[str, tuple[Sequence[Joint | Loop], object]] = {
        "joint": (linkage.joint, TreeType),
        "loop": (linkage.loop, CutType),
    }
    for table, (joints, types) in tables.items():
        of = {name: JOINT_TYPES[name].own_keys(types is CutType) for name in get_args(types)}
        if linkage.dimension > 2:  # whose axes are numbers: checks/space.py
            of = {name: tuple({*keys} - {AXIS, ANGLE}) for name, keys in of.items()}
        for key in dict.fromkeys(key for keys in of.values() for key in keys):
            able = " or ".join(f'"{name}"' for name in of if key in of[name])
            for i, joint in enumerate(joints):
                path: Path = ("linkage", table, i, key.name)
                given = getattr(joint, key.name) is not None
                if key not in of[joint.type] and given:
                    text = f"a {joint.type} joint has no {key.what}: leave it out"
                    yield path, f"{text}, or type = {able}"
                elif key in of[joint.type] and key.required and not given:
                    yield path, f"a {joint.type} joint needs its {key.what} ({key.unit})"


def _gears(linkage: Linkage) -> Iterator[Problem]:
    joints = {j.name: j for j in linkage.joint}
    names = [loop.name for loop in linkage.loop]
    for i, gear in enumerate(linkage.gear):
        path: Path = ("linkage", "gear", i)
        for k, name in enumerate(gear.joints):
            if (joint := joints.get(name)) is None:
                yield (*path, "joints", k), unknown("joint", name, joints)
            elif joint.kind.size > 1:
                text = f"{name!r} is {joint.type}: a gear couples single coordinates"
                yield (*path, "joints", k), text
        if gear.joints[0] == gear.joints[1]:
            yield (*path, "joints"), "a gear couples two different joints"
        if gear.name is not None and gear.name in names:
            yield (*path, "name"), f"{gear.name!r} is taken: name each loop and gear once"
        names.append(gear.name)


def _tree(linkage: Linkage, frames: Mapping[str, int]) -> Iterator[Problem]:
    """Problems unless the joints form a tree: each body is the child of exactly one joint, and is
    connected to ground."""
    parents: dict[str, str] = {}
    names: set[str] = set()
    for i, joint in enumerate(linkage.joint):
        path: Path = ("linkage", "joint", i)
        if joint.name in names:
            yield (*path, "name"), f"{joint.name!r} is taken: name each joint once"
        names.add(joint.name)
        for end in ("parent", "child"):
            if getattr(joint, end) not in frames:
                yield (*path, end), unknown("body", getattr(joint, end), frames)
        if joint.child == "ground":
            yield (*path, "child"), "ground cannot be a child: turn the joint around"
        elif joint.child in parents:
            yield (
                (*path, "child"),
                f"{joint.child!r} hangs on {parents[joint.child]!r} already: close loops "
                "with [[linkage.loop]]",
            )
        else:
            parents[joint.child] = joint.parent
        if joint.ports and joint.kind.size > 1:
            text = f"ports are of one coordinate, and a {joint.type} joint has {joint.kind.count}"
            yield (*path, "ports"), text
        if "effort" in joint.ports and isinstance(joint.drive, ConstantDrive):
            message = f"{joint.name}.effort is the drive's constant already: leave out one of them"
            yield (*path, "ports"), message
    held = {"ground"}
    for name, i in frames.items():
        way: dict[str, None] = {}
        while name in parents and name not in held and name not in way:
            way[name] = None
            name = parents[name]
        if name in way:
            yield ("linkage", "body", i), "its joints run in a circle: start the tree at 'ground'"
        elif not way and name not in held:
            yield ("linkage", "body", i), "no joint holds this body: give it one as child"
        held |= way.keys()  # reported once


def _limits(linkage: Linkage) -> Iterator[Problem]:
    for kind in ("joint", "loop"):
        for i, part in enumerate(getattr(linkage, kind)):
            path: Path = ("linkage", kind, i, "limits")
            if (limits := part.limits) is None:
                continue
            lower, upper = limits.lower, limits.upper
            if kind == "joint" and part.kind.size > 1:
                text = f"a {part.type} joint has {part.kind.count} coordinates"
                yield path, f"{text}: limit joints of one coordinate"
            if lower is None and upper is None:
                yield path, "there is no limit: give `lower`, `upper` or both"
            elif lower is not None and upper is not None and lower >= upper:
                yield (*path, "upper"), f"{upper!r} is not above `lower` = {lower!r}"
            if limits.damping is not None and limits.restitution is not None:
                message = "the damping follows from it: give `damping` or `restitution`, not both"
                yield (*path, "restitution"), message


def points(scene: Scene) -> Iterator[Problem]:
    """Problems of [[linkage.point]] and of the hands, devices and controllers at these points."""
    points = scene.linkage.point if scene.linkage else ()
    bodies = {b.name for b in scene.linkage.body} if scene.linkage else set()
    names: set[str] = {"operational_point"}
    for i, point in enumerate(points):
        path: Path = ("linkage", "point", i)
        if point.name in names:
            yield (*path, "name"), f"{point.name!r} is taken: name each point once"
        if not point.name.isidentifier():
            yield (*path, "name"), f"{point.name!r}: a name of letters, digits and _"
        names.add(point.name)
        if point.body not in bodies:
            yield (*path, "body"), unknown("body", point.body, sorted(bodies))
    named = dict.fromkeys(sorted(names - {"operational_point"}))
    for table in ("hands", "devices", "controllers"):
        for name in getattr(scene, table):
            if name not in named:
                yield (table, name), f"{unknown('point', name, named)}: add it as [[linkage.point]]"
            elif table == "controllers" and name not in scene.devices:
                yield (table, name), f"moves a device: add [devices.{name}], or take it out"
