"""Checks the names of a linkage: a tree of joints, loops between bodies, points on bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hapticlink.components.specs.drives import ConstantDrive
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.errors import unknown
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def check_linkage(scene: Scene) -> Iterator[Problem]:
    if (linkage := scene.linkage) is None:
        return
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
    yield from _cuts(linkage)
    yield from _gears(linkage)
    yield from _limits(linkage)
    if linkage.operational_point.body not in bodies:
        message = unknown("body", linkage.operational_point.body, bodies)
        yield (*here, "operational_point", "body"), message
    types = {j.name: j.type for j in linkage.joint}
    for table in ("start", "start_velocity"):
        for name, value in getattr(linkage, table).items():
            if name not in types:
                yield (*here, table, name), unknown("joint", name, types)
            elif isinstance(value, tuple) != (types[name] == "free"):
                wanted = "three numbers" if types[name] == "free" else "one number"
                yield (*here, table, name), f"{value!r}: a {types[name]} joint takes {wanted}"


def _cuts(linkage: Linkage) -> Iterator[Problem]:
    """Problems of keys that a kind of cut joint needs, or does not have."""
    for i, loop in enumerate(linkage.loop):
        path: Path = ("linkage", "loop", i)
        if loop.type != "revolute" and loop.axis is None:
            yield (*path, "axis"), f"a {loop.type} joint needs its direction (rad)"
        if loop.type == "revolute" and loop.axis is not None:
            yield (
                (*path, "axis"),
                'a revolute joint has no direction: leave it out, or type = "slot"',
            )
        if loop.type != "prismatic" and loop.angle is not None:
            yield (*path, "angle"), f"a {loop.type} joint turns freely: leave its angle out"


def _gears(linkage: Linkage) -> Iterator[Problem]:
    types = {j.name: j.type for j in linkage.joint}
    names = [loop.name for loop in linkage.loop]
    for i, gear in enumerate(linkage.gear):
        path: Path = ("linkage", "gear", i)
        for k, name in enumerate(gear.joints):
            if name not in types:
                yield (*path, "joints", k), unknown("joint", name, types)
            elif types[name] == "free":
                yield (*path, "joints", k), f"{name!r} is free: a gear couples single coordinates"
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
        if joint.ports and joint.type == "free":
            yield (*path, "ports"), "ports are of one coordinate, and a free joint has three"
        if "effort" in joint.ports and isinstance(joint.drive, ConstantDrive):
            message = f"{joint.name}.effort is the drive's constant already: leave out one of them"
            yield (*path, "ports"), message
        if joint.type == "prismatic" and joint.axis is None:
            yield (*path, "axis"), "a prismatic joint needs its direction (rad)"
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
            if kind == "joint" and part.type == "free":
                yield path, "a free joint has three coordinates: limit revolute or prismatic joints"
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
