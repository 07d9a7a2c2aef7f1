"""Masses and geometry of a linkage as parameters, and its coordinates by joint."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hapticlink.components.component import Variable
from hapticlink.components.specs.joint_types import OwnKey
from hapticlink.components.specs.linkage import Joint, Linkage, Loop
from hapticlink.components.specs.quantities import Place


def body_parameters(linkage: Linkage) -> tuple[Variable, ...]:
    """Masses and geometry as `fixed` FMI parameters: `link1.mass`, `elbow1.at_parent[1]`.

    A point that the scene does not mention has no parameter: it is the frame's origin. Nor have
    the axes of joints in space, which are numbers of the equations.
    """

    def fixed(name: str, unit: str, value: float | tuple[float, ...], text: str) -> Variable:
        shape = () if isinstance(value, int | float) else (len(value),)
        return Variable(name, shape, unit, value, text, variability="fixed")

    def of_type(name: str, joint: Joint | Loop, keys: tuple[OwnKey, ...]) -> Iterator[Variable]:
        for key in keys:
            value = getattr(joint, key.name)
            if not isinstance(value, tuple) and (linkage.dimension == 2 or value is not None):
                text = f"{key.what} of {name}"
                yield fixed(f"{name}.{key.name}", key.unit, value or 0.0, text)

    rows = []
    for b in linkage.body:
        text = f"inertia of {b.name} about its centre"
        rows.append(fixed(f"{b.name}.mass", "kg", b.mass, f"mass of {b.name}"))
        rows.append(fixed(f"{b.name}.inertia", "kg.m2", b.inertia, text))
        if b.center is not None:
            rows.append(fixed(f"{b.name}.center", "m", b.center, f"centre of mass of {b.name}"))
    for j in linkage.joint:
        if j.at_parent is not None:
            rows.append(fixed(f"{j.name}.at_parent", "m", j.at_parent, f"{j.name} on {j.parent}"))
        if j.at_child is not None:
            rows.append(fixed(f"{j.name}.at_child", "m", j.at_child, f"{j.name} on {j.child}"))
        rows += of_type(j.name, j, j.kind.own_keys(cut=False))
    for i, loop in enumerate(linkage.loop):
        name = loop_name(linkage, i)
        for k, (body, at) in enumerate(zip(loop.bodies, loop.at, strict=True)):
            rows.append(fixed(f"{name}.at{k + 1}", "m", at, f"{name} on {body}"))
        rows += of_type(name, loop, loop.kind.own_keys(cut=True))
    named = {name: (linkage.points[name], name) for name in linkage.choices}
    own = {"operational_point": (linkage.held, "operational point")}
    further = {point.name: (point, point.name) for point in linkage.point}
    for name, (point, text) in {**(named or own), **further}.items():
        if point.at is not None:
            rows.append(fixed(f"{name}.at", "m", point.at, f"{text} on {point.body}"))
    return tuple(rows)


def loop_name(linkage: Linkage, index: int) -> str:
    return linkage.loop[index].name or f"loop{index + 1}"


def distance(a: Place, b: Place) -> float:
    """Between two points of a body (m)."""
    return math.dist((*a, 0.0)[:3], (*b, 0.0)[:3])


def mean_link_length(linkage: Linkage) -> float:
    """Mean over the bodies of the largest distance between two of their joint points (m).

    For a linkage without any such distance, the mean radius of gyration. Objects do not count.
    """
    bodies = [b for b in linkage.body if b.name not in linkage.objects]
    points: dict[str, list[Place]] = {b.name: [] for b in bodies}
    for j in linkage.joint:
        if j.child in points:
            points[j.child].append(j.at_child or (0.0, 0.0))
        if j.parent in points:
            points[j.parent].append(j.at_parent or (0.0, 0.0))
    for loop in linkage.loop:
        for body, point in zip(loop.bodies, loop.at, strict=True):
            if body in points:
                points[body].append(point)
    spans = [max(distance(a, b) for a in p for b in p) for p in points.values() if p]
    lengths = [s for s in spans if s > 0] or [
        math.sqrt(b.moments[-1] / b.mass) for b in bodies if b.mass > 0 and b.moments[-1] > 0
    ]
    return sum(lengths) / len(lengths) if lengths else 1.0
