"""Broad phase: pairs that can never touch and need no narrow phase.

A chain of joints that only turn keeps every point of a body within the sum of its links' lengths of
the joint on the ground. A joint that slides has no such bound. Loops only reduce the reach. Lengths
are those of the scene, so the result is fixed when the FMU is built; all other pairs are evaluated
at every pose.
"""

from __future__ import annotations

import math

from hapticlink.components.specs.bodies import counterclockwise, edges
from hapticlink.components.specs.contacts import Contacts, Pair, pairs
from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.quantities import Point, in_plane

ORIGIN = (0.0, 0.0)


def reach(linkage: Linkage, body: str) -> tuple[Point, float]:
    """Centre and radius (m) of a disc that the body's shape never leaves; the radius may be inf."""
    by_child = {j.child: j for j in linkage.joint}
    shape = next(b for b in linkage.body if b.name == body)
    joint = by_child[body]
    here = in_plane(joint.at_child)
    length = max(math.dist(here, end) for end in shape.shape) + (shape.radius or 0.0)
    while True:
        if joint.kind.slides:
            return ORIGIN, math.inf
        there = in_plane(joint.at_parent)
        if joint.parent == "ground":
            return there, length
        joint = by_child[joint.parent]
        length += math.dist(there, in_plane(joint.at_child))


def near(linkage: Linkage, contacts: Contacts) -> tuple[Pair, ...]:
    """The pairs that can touch."""
    far = set(out_of_reach(linkage, contacts))
    return tuple(pair for pair in pairs(linkage, contacts) if pair not in far)


def out_of_reach(linkage: Linkage, contacts: Contacts) -> tuple[Pair, ...]:
    """The pairs that can never touch; none without a broad phase."""
    if not contacts.broad_phase:
        return ()
    return tuple(p for p in pairs(linkage, contacts) if not _can_touch(linkage, contacts, p))


def _can_touch(linkage: Linkage, contacts: Contacts, pair: Pair) -> bool:
    center, radius = reach(linkage, pair.body)
    if pair.kind == "body":
        other, further = reach(linkage, pair.obstacle)
        return math.dist(center, other) < radius + further
    if pair.kind == "disc":
        disc = contacts.disc[pair.index]
        return math.dist(center, disc.center) < radius + disc.radius
    if pair.kind == "enclosure":
        walls = edges(counterclockwise(contacts.enclosure or ()))
        return any(_beyond(center, *wall) > -radius for wall in walls)
    walls = edges(counterclockwise(contacts.polygon[pair.index].corners))
    if all(_beyond(center, *wall) <= 0 for wall in walls):
        return True
    return min(_distance(center, *wall) for wall in walls) < radius


def _beyond(point: Point, a: Point, b: Point) -> float:
    """Distance of a point to the right of a -> b, negative on the left."""
    across = (b[1] - a[1]) * (point[0] - a[0]) - (b[0] - a[0]) * (point[1] - a[1])
    return across / math.dist(a, b)


def _distance(point: Point, a: Point, b: Point) -> float:
    """Distance of a point to the segment a b."""
    along = (b[0] - a[0]) * (point[0] - a[0]) + (b[1] - a[1]) * (point[1] - a[1])
    s = min(max(along / math.dist(a, b) ** 2, 0.0), 1.0)
    return math.dist(point, (a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])))
