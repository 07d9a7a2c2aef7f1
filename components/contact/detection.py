"""Narrow phase: points, normals and gaps where a body is nearest to an obstacle or another body,
with bounded work.

A shape is the points within `radius` of its core: a point, a segment or a convex polygon. Each
place of a pair is a `Touch`: a point on the core of the body, and the plane of the other shape that
faces it. The number of places is fixed, each with a flag whether it is active, so that there is no
iteration and no branch.

    enclosure   each corner of the core against its two nearest walls; with friction, against all
    disc        the core's point nearest to the centre, or the centre's nearest on the other core
    otherwise   each corner of either core, and the other core's point that is nearest to it

Each place is a spring k max(0, -g)^2/2, which acts on both bodies. Its gap g is continuous in the
pose, so that the force is the gradient of a potential: a corner that passes the end of a link
leaves it, as the end leaves the corner's edge, within a distance of sqrt(2 radius depth). Within a
polygon the gap is negative, and a place is pushed out through the nearest edge. A segment has no
inside: a corner that has sunk past the axis of a link goes on to be pushed back on the side where
it entered, up to the shortest way out of the polygon (closest_points.py); there alone a gap can
jump, if that side changes or the corner passes an end of the link. Runs warn of contacts that deep
(depth.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca

from hapticlink.components.component import Signals, Variable
from hapticlink.components.contact.broad_phase import near
from hapticlink.components.contact.closest_points import (
    edges,
    nearest_on_boundary,
    nearest_on_point,
    nearest_on_segment,
    select,
    sunk_past,
)
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.bodies import counterclockwise
from hapticlink.components.specs.contacts import Contacts, Pair

COLUMNS = ("1", "m", "m", "m", "m", "1", "1")
"""Units of a row of the `contacts` port: active, point in the body (x, y), point of the plane
(x, y), normal of the plane (x, y), both in the other body or the world."""


@dataclass(frozen=True)
class Touch:
    """A potential contact: a point in a body's frame, and a plane in the world, of another body or
    the ground."""

    body: str
    other: str
    active: ca.SX
    point: ca.SX
    plane: ca.SX
    normal: ca.SX


@dataclass(frozen=True)
class Shape:
    """The points within `radius` of a core, whose corners (k x 2) are in the frame of `body`."""

    body: str
    corners: ca.SX
    radius: ca.SX | float


def obstacle_parameters(contacts: Contacts) -> list[Variable]:
    """Geometry of the obstacles as `fixed` parameters, corners counterclockwise."""

    def corners(name: str, points: tuple[tuple[float, float], ...]) -> Variable:
        ordered = counterclockwise(points)
        flat = tuple(value for point in ordered for value in point)
        text = f"corners of {name}, counterclockwise"
        return Variable(f"{name}.corners", (len(points), 2), "m", flat, text, "fixed")

    rows = []
    if contacts.enclosure:
        rows.append(corners("enclosure", contacts.enclosure))
    for i, disc in enumerate(contacts.disc):
        name = disc.name or f"disc{i + 1}"
        text = f"centre of {name}"
        rows.append(Variable(f"{name}.center", (2,), "m", disc.center, text, "fixed"))
        rows.append(Variable(f"{name}.radius", (), "m", disc.radius, f"radius of {name}", "fixed"))
    for i, polygon in enumerate(contacts.polygon):
        rows.append(corners(polygon.name or f"polygon{i + 1}", polygon.corners))
    return rows


def shape_parameters(pairs: tuple[Pair, ...], model_bodies: dict[str, float]) -> list[Variable]:
    """Radii of the bodies that can touch something, as parameters."""
    touched = [(p.body, p.obstacle) if p.kind == "body" else (p.body,) for p in pairs]
    names = dict.fromkeys(name for names in touched for name in names)
    return [
        Variable(f"{n}.radius", (), "m", model_bodies[n], f"radius of {n}", "fixed") for n in names
    ]


def touches(model: LinkageModel, contacts: Contacts, p: Signals) -> list[Touch]:
    """Every place of every pair within reach, in the order of `broad_phase.near`."""
    touching: list[Touch] = []
    for pair in near(model.linkage, contacts):
        body = _body(model, pair.body)
        if pair.kind == "enclosure":
            at_end = _in_corner if contacts.friction is None else _at_walls
            touching += [t for end in _rows(body) for t in at_end(model, pair.body, end, p)]
        else:
            touching += _between(model, body, _obstacle(model, pair, p))
    return touching


def _body(model: LinkageModel, name: str) -> Shape:
    shape = next(b for b in model.linkage.body if b.name == name).shape
    return Shape(name, ca.SX(ca.DM(shape)), model.p[f"{name}.radius"])


def _obstacle(model: LinkageModel, pair: Pair, p: Signals) -> Shape:
    if pair.kind == "body":
        return _body(model, pair.obstacle)
    if pair.kind == "disc":
        return Shape("ground", p[f"{pair.obstacle}.center"].T, p[f"{pair.obstacle}.radius"])
    return Shape("ground", p[f"{pair.obstacle}.corners"], 0.0)


def _rows(shape: Shape) -> list[ca.SX]:
    return [shape.corners[k, :].T for k in range(shape.corners.shape[0])]


def _at_walls(model: LinkageModel, body: str, end: ca.SX, p: Signals) -> list[Touch]:
    walls = edges(p["enclosure.corners"])
    return [Touch(body, "ground", ca.SX(1), end, a, -outward) for a, _, outward in walls]


def _in_corner(model: LinkageModel, body: str, end: ca.SX, p: Signals) -> list[Touch]:
    point = model.frames[body].point(end)
    walls = [
        [ca.dot(point - a, -outward), a, -outward]
        for a, _, outward in edges(p["enclosure.corners"])
    ]
    first, second = select(walls[0][0] < walls[1][0], walls[0] + walls[1], walls[1] + walls[0]), []
    first, second = first[:3], first[3:]
    for wall in walls[2:]:
        nearer, next_one = wall[0] < first[0], wall[0] < second[0]
        second = select(nearer, first, select(next_one, wall, second))
        first = select(nearer, wall, first)
    return [Touch(body, "ground", ca.SX(1), end, plane, n) for _, plane, n in (first, second)]


def _between(model: LinkageModel, a: Shape, b: Shape) -> Iterator[Touch]:
    """The places of two shapes: each corner of either core at the other core; of a point alone."""
    frame, other = model.frames[a.body], model.frames[b.body]
    if b.corners.shape[0] > 1:
        for corner in _rows(a):
            plane, normal = _nearest(b, other.local(frame.point(corner)))
            outward = other.rotation @ normal
            position = other.point(plane) + b.radius * outward
            yield Touch(a.body, b.body, ca.SX(1), corner, position, outward)
    if a.corners.shape[0] > 1 or b.corners.shape[0] == 1:
        world = [other.point(corner) for corner in _rows(b)]
        seen = [frame.local(position) for position in world]
        backs: list[ca.SX] = [ca.SX(0)] * len(seen)
        if a.corners.shape[0] == 2 and len(seen) > 2:
            backs = sunk_past(a.corners, ca.horzcat(*seen).T)
        for position, local, back in zip(world, seen, backs, strict=True):
            point, normal = _nearest(a, local, back)
            inward = -(frame.rotation @ normal)
            yield Touch(a.body, b.body, ca.SX(1), point, position + b.radius * inward, inward)


def _nearest(shape: Shape, position: ca.SX, back: ca.SX | int = 0) -> list[ca.SX]:
    """Point and outward normal of a core that is nearest to a point of its frame."""
    corners = shape.corners
    if corners.shape[0] == 1:
        return nearest_on_point(corners.T, position)
    if corners.shape[0] == 2:
        return nearest_on_segment(corners, position, back)
    return nearest_on_boundary(edges(corners), position)
