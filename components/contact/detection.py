"""Narrow phase: point, normal and gap where a link is nearest to an obstacle, with bounded work.

A link is a capsule, the points within `radius` of a segment. Each place of a pair is a `Touch`: a
point on the segment, and the plane of the obstacle that faces it. The number of places is fixed,
each with a flag whether it is active, so that there is no iteration and no branch.

    enclosure   each end against its two nearest walls; with friction, against all walls
    disc        the segment's point nearest to the centre
    polygon     each end's nearest point of the boundary, and the corner that is nearest to
                the inside of the segment

A link that penetrates deeper than its radius is still pushed back out on the side where it entered,
up to the middle of the obstacle, where another side is as near (closest_points.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from hapticlink.components.component import Signals, Variable
from hapticlink.components.contact.broad_phase import counterclockwise, near
from hapticlink.components.contact.closest_points import (
    TINY,
    along,
    between,
    edges,
    nearest_on_boundary,
    select,
    way_out,
)
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.contacts import Contacts, Pair

COLUMNS = ("1", "m", "m", "m", "m", "1", "1")
"""Units of a row of the `contacts` port: active, point in the body (x, y), point of the plane
(x, y), normal of the plane (x, y)."""


@dataclass(frozen=True)
class Touch:
    """A potential contact: a point in the body's frame, and a plane in the world."""

    body: str
    active: ca.SX
    point: ca.SX
    plane: ca.SX
    normal: ca.SX

    @property
    def row(self) -> ca.SX:
        return ca.vertcat(self.active, self.point, self.plane, self.normal).T


def obstacle_parameters(contacts: Contacts) -> list[Variable]:
    """Geometry of the obstacles as `fixed` parameters, corners counterclockwise."""

    def corners(name: str, points: tuple[tuple[float, float], ...]) -> Variable:
        ordered = counterclockwise(points)
        flat = tuple(value for point in ordered for value in point)
        text = f"corners of {name}, counterclockwise"
        return Variable(f"{name}.corners", (len(points), 2), "m", flat, text, "fixed")

    found = []
    if contacts.enclosure:
        found.append(corners("enclosure", contacts.enclosure))
    for i, disc in enumerate(contacts.disc):
        name = disc.name or f"disc{i + 1}"
        text = f"centre of {name}"
        found.append(Variable(f"{name}.center", (2,), "m", disc.center, text, "fixed"))
        found.append(Variable(f"{name}.radius", (), "m", disc.radius, f"radius of {name}", "fixed"))
    for i, polygon in enumerate(contacts.polygon):
        found.append(corners(polygon.name or f"polygon{i + 1}", polygon.corners))
    return found


def shape_parameters(pairs: tuple[Pair, ...], model_bodies: dict[str, float]) -> list[Variable]:
    """Radii of the bodies that can touch something, as parameters."""
    names = dict.fromkeys(pair.body for pair in pairs)
    return [
        Variable(f"{n}.radius", (), "m", model_bodies[n], f"radius of {n}", "fixed") for n in names
    ]


def touches(model: LinkageModel, contacts: Contacts, p: Signals) -> list[Touch]:
    """Every place of every pair within reach, in the order of `broad_phase.near`."""
    found = []
    for pair in near(model.linkage, contacts):
        ends = _ends(model, pair.body)
        if pair.kind == "enclosure":
            at_end = _in_corner if contacts.friction is None else _at_walls
            found += [t for end in ends for t in at_end(model, pair.body, end, p)]
        elif pair.kind == "disc":
            found.append(_on_disc(model, pair, ends, p))
        else:
            found += _on_polygon(model, pair, ends, p)
    return found


def _ends(model: LinkageModel, body: str) -> list[ca.SX]:
    shape = next(b for b in model.linkage.body if b.name == body)
    return [ca.SX(list(end)) for end in shape.capsule]


def _at_walls(model: LinkageModel, body: str, end: ca.SX, p: Signals) -> list[Touch]:
    walls = edges(p["enclosure.corners"])
    return [Touch(body, ca.SX(1), end, a, -outward) for a, _, outward in walls]


def _in_corner(model: LinkageModel, body: str, end: ca.SX, p: Signals) -> list[Touch]:
    at = model.frames[body].point(end)
    walls = [
        [ca.dot(at - a, -outward), a, -outward] for a, _, outward in edges(p["enclosure.corners"])
    ]
    first, second = select(walls[0][0] < walls[1][0], walls[0] + walls[1], walls[1] + walls[0]), []
    first, second = first[:3], first[3:]
    for wall in walls[2:]:
        nearer, next_one = wall[0] < first[0], wall[0] < second[0]
        second = select(nearer, first, select(next_one, wall, second))
        first = select(nearer, wall, first)
    return [Touch(body, ca.SX(1), end, plane, normal) for _, plane, normal in (first, second)]


def _on_disc(model: LinkageModel, pair: Pair, ends: list[ca.SX], p: Signals) -> Touch:
    center, radius = p[f"{pair.obstacle}.center"], p[f"{pair.obstacle}.radius"]
    world = [model.frames[pair.body].point(end) for end in ends]
    s = ca.fmin(ca.fmax(along(ends, world, center), 0), 1)
    away = between(world, s) - center
    distance = ca.norm_2(away)
    # If the link's axis passes through the centre the direction is undefined: take its normal.
    span = world[-1] - world[0] if len(world) == 2 else ca.SX([1.0, 0.0])
    across = ca.vertcat(-span[1], span[0]) / ca.norm_2(span)
    normal = ca.if_else(distance > 0, away / (distance + TINY), across)
    return Touch(pair.body, ca.SX(1), between(ends, s), center + radius * normal, normal)


def _on_polygon(model: LinkageModel, pair: Pair, ends: list[ca.SX], p: Signals) -> list[Touch]:
    corners = p[f"{pair.obstacle}.corners"]
    world = [model.frames[pair.body].point(end) for end in ends]
    found = []
    for end, at in zip(ends, world, strict=True):
        plane, normal = nearest_on_boundary(edges(corners), at)
        found.append(Touch(pair.body, ca.SX(1), end, plane, normal))
    if len(ends) == 2:
        found.append(_nearest_corner(pair.body, ends, world, corners))
    return found


def _nearest_corner(body: str, ends: list[ca.SX], world: list[ca.SX], corners: ca.SX) -> Touch:
    """The corner nearest to the segment between its ends; not active where none faces it.

    The plane is parallel to the segment. Its normal points to the segment, or, if the segment has
    penetrated past the corner by no more than its distance to the outside, to that side.
    """
    span = world[1] - world[0]
    side = ca.vertcat(-span[1], span[0]) / ca.norm_2(span)
    heights = [ca.dot(side, world[0] - corners[k, :].T) for k in range(corners.shape[0])]
    depth, outward = way_out(world, corners, side, heights)
    up = ca.if_else(ca.dot(outward, side) >= 0, 1, -1)
    best: list[ca.SX] = []
    for k, height in enumerate(heights):
        corner = corners[k, :].T
        s = along(ends, world, corner)
        inside = ca.logic_and(s > 0, s < 1)
        sunk = ca.logic_and(depth <= up * height, depth < 0)
        sign = ca.if_else(sunk, up, ca.if_else(height >= 0, 1, -1))
        distance = ca.if_else(inside, sign * height, ca.SX(1e9))
        point = between(ends, ca.fmin(ca.fmax(s, 0), 1))
        this = [distance, inside, point, corner, sign * side]
        best = select(distance < best[0], this, best) if best else this
    return Touch(body, *best[1:])
