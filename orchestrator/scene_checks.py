"""What the shape of a scene cannot say: names that must exist, numbers that must be positive,
tables that need each other. Each check yields (path in the file, message with remedy)."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hapticlink.components.specs import Linkage
from hapticlink.orchestrator import (
    contact_checks,
    coupling_checks,
    foreign_checks,
    needs,
    option_checks,
    rate_checks,
)
from hapticlink.orchestrator.conditions import parse_condition
from hapticlink.orchestrator.faults import unknown
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.latency import Latency
from hapticlink.orchestrator.scene import Scene
from hapticlink.orchestrator.toml_lines import Path

Problem = tuple[Path, str]


def check(scene: Scene) -> list[Problem]:
    """Every fault found, in the order of the file's sections."""
    found = [*_numbers(scene), *rate_checks.check(scene), *_holds(scene), *_blocks(scene)]
    found += foreign_checks.check(scene)
    if scene.linkage:
        found += _linkage(scene.linkage)
    found += contact_checks.check(scene)
    found += coupling_checks.check(scene)
    found += option_checks.check(scene)
    return found


def _numbers(scene: Scene) -> Iterator[Problem]:
    if scene.duration <= 0:
        yield ("duration",), f"{scene.duration} s: a run takes more than 0 s"
    if scene.stop_when:
        try:
            parse_condition(scene.stop_when)
        except ValueError as error:
            yield ("stop_when",), str(error)
    for table in ("mechanism", "graphics", "device"):
        record = getattr(scene, table)
        if record and record.substeps < 1:
            yield (table, "substeps"), f"{record.substeps}: at least 1 substep"


def _holds(scene: Scene) -> Iterator[Problem]:
    if scene.hold not in HOLDS:
        yield ("hold",), unknown("hold", scene.hold, HOLDS)
    if scene.downsampling not in ("latest", "mean"):
        message = unknown("downsampling", scene.downsampling, ("latest", "mean"))
        yield ("downsampling",), message
    for name, steps in scene.substeps.items():
        if steps < 1:
            yield ("substeps", name), f"{steps}: at least 1 substep"
    for name, late in scene.delays.items():
        yield from _latency(("delays", name), late)
    for connection, hold in scene.holds.items():
        if hold not in HOLDS:
            yield ("holds", connection), unknown("hold", hold, HOLDS)


def _latency(path: Path, late: float | Latency) -> Iterator[Problem]:
    given = late if isinstance(late, Latency) else Latency(min=late)
    if given.min < 0:
        yield path, f"{given.min} s: a latency is 0 or more"
    if given.max is not None and given.max < given.min:
        yield path, f"max = {given.max} s is below min = {given.min} s: swap them"
    if not 0 <= given.loss <= 1:
        yield path, f"loss = {given.loss}: a probability is between 0 and 1"
    if given.seed < 0:
        yield path, f"{given.seed}: a seed is 0 or more"


def _blocks(scene: Scene) -> Iterator[Problem]:
    if not scene.linkage and not scene.device and not scene.fmu:
        yield ("linkage",), "nothing to simulate: give a [linkage], a [device] or an [[fmu]]"
    if not scene.linkage:
        for table in ("graphics", "controller"):
            if getattr(scene, table) and not (table == "graphics" and scene.fmu):
                yield (table,), f"[{table}] needs a [linkage]: add one, or take [{table}] out"
    if scene.controller and not scene.device:
        yield ("controller",), "[controller] moves a device: add [device], or take it out"
    if scene.hand and not scene.device and not scene.linkage:
        yield ("hand",), "[hand] holds a device or a linkage: add one, or take it out"
    if scene.sensing == "encoders" and not scene.device:
        yield ("sensing",), "'encoders' are the device's: add [device], or take sensing out"
    if not scene.graphics:
        if scene.mechanism_at == "graphics":
            yield ("mechanism_at",), "there is no graphics rate: add [graphics] with its rate"
        if scene.directions_from == "graphics" and (
            needs.mobility_from_graphics(scene) or needs.directions_from_graphics(scene)
        ):
            yield (
                ("directions_from",),
                "the controller needs Lambda_inv and P_c: add [graphics], or take "
                "directions_from = 'mechanism'",
            )


def _linkage(linkage: Linkage) -> Iterator[Problem]:
    here: Path = ("linkage",)
    bodies = [b.name for b in linkage.body]
    frames = ["ground", *bodies]
    for i, body in enumerate(linkage.body):
        path: Path = (*here, "body", i)
        if body.name in frames[: i + 1]:
            yield (*path, "name"), f"{body.name!r} is taken: name each body once, none 'ground'"
        if body.mass <= 0:
            yield (*path, "mass"), f"{body.mass} kg: a mass is more than 0"
        if body.inertia < 0:
            yield (*path, "inertia"), f"{body.inertia} kg.m2: an inertia is 0 or more"
    yield from _tree(linkage, frames)
    for i, loop in enumerate(linkage.loop):
        for k, name in enumerate(loop.bodies):
            if name not in frames:
                yield (*here, "loop", i, "bodies", k), unknown("body", name, frames)
        if loop.bodies[0] == loop.bodies[1]:
            yield (*here, "loop", i, "bodies"), "a loop joins two different bodies"
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
            elif isinstance(value, float) and not math.isfinite(value):
                yield (*here, table, name), f"{value!r} is not finite"


def _tree(linkage: Linkage, frames: list[str]) -> Iterator[Problem]:
    """Every body hangs on ground by exactly one joint of each body on the way."""
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
        if joint.type == "prismatic" and joint.axis is None:
            yield (*path, "axis"), "a prismatic joint needs its direction (rad)"
    for i, name in enumerate(frames[1:]):
        seen: set[str] = set()
        at = name
        while at in parents and at not in seen:
            seen.add(at)
            at = parents[at]
        if name not in parents:
            yield ("linkage", "body", i), "no joint holds this body: give it one as child"
        elif at in seen:
            yield ("linkage", "body", i), "its joints run in a circle: start the tree at 'ground'"
