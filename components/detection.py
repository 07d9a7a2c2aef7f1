"""Where a link is nearest to what it can touch: point, normal and gap, by bounded work.

A link is a capsule, the points within `radius` of a segment. Each place of a pair is a `Touch`: a
point on the segment, and the plane of the obstacle that faces it. There is always a fixed number
of places, each with a flag: no iteration, no branch.

    enclosure   each end against its two nearest walls
    disc        the segment's point nearest to the centre
    polygon     each end's nearest point of the boundary, and the corner that is nearest to
                the inside of the segment

Closest points: Ericson, Real-Time Collision Detection (2005), sections 5.1.2 and 5.1.9. The
segment itself must stay outside: a link may sink in by its radius, no deeper.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from hapticlink.components.component import Signals, Variable
from hapticlink.components.contact_specs import Contacts, Pair
from hapticlink.components.linkage import LinkageModel
from hapticlink.components.reach import counterclockwise, near

TINY = 1e-300
COLUMNS = ("1", "m", "m", "m", "m", "1", "1")
"""A row of the `contacts` port: active, point in the body (x, y), point and normal of the plane."""


@dataclass(frozen=True)
class Touch:
    """A place where a link may touch: in the body's frame the point, in the world the plane."""

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
        found.append(Variable(f"{name}.radius", (), "m", disc.radius, f"of {name}", "fixed"))
    for i, polygon in enumerate(contacts.polygon):
        found.append(corners(polygon.name or f"polygon{i + 1}", polygon.corners))
    return found


def shape_parameters(pairs: tuple[Pair, ...], model_bodies: dict[str, float]) -> list[Variable]:
    """Radii of the bodies that can touch something, by body name."""
    names = dict.fromkeys(pair.body for pair in pairs)
    return [
        Variable(f"{n}.radius", (), "m", model_bodies[n], f"radius of {n}", "fixed") for n in names
    ]


def touches(model: LinkageModel, contacts: Contacts, p: Signals) -> list[Touch]:
    """Every place of every pair within reach, in the order of `reach.near`."""
    found = []
    for pair in near(model.linkage, contacts):
        ends = _ends(model, pair.body)
        if pair.kind == "enclosure":
            found += [t for end in ends for t in _in_corner(model, pair.body, end, p)]
        elif pair.kind == "disc":
            found.append(_on_disc(model, pair, ends, p))
        else:
            found += _on_polygon(model, pair, ends, p)
    return found


def _ends(model: LinkageModel, body: str) -> list[ca.SX]:
    shape = next(b for b in model.linkage.body if b.name == body)
    return [ca.SX(list(end)) for end in shape.capsule]


def _edges(corners: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX]]:
    """(start, end, normal to the right) of each edge."""
    number = corners.shape[0]
    found = []
    for k in range(number):
        a, b = corners[k, :].T, corners[(k + 1) % number, :].T
        along = b - a
        found.append((a, b, ca.vertcat(along[1], -along[0]) / ca.norm_2(along)))
    return found


def _select(condition: ca.SX, one: list[ca.SX], other: list[ca.SX]) -> list[ca.SX]:
    return [ca.if_else(condition, a, b) for a, b in zip(one, other, strict=True)]


def _in_corner(model: LinkageModel, body: str, end: ca.SX, p: Signals) -> list[Touch]:
    at = model.frames[body].point(end)
    walls = [
        [ca.dot(at - a, -outward), a, -outward] for a, _, outward in _edges(p["enclosure.corners"])
    ]
    first, second = _select(walls[0][0] < walls[1][0], walls[0] + walls[1], walls[1] + walls[0]), []
    first, second = first[:3], first[3:]
    for wall in walls[2:]:
        nearer, next_one = wall[0] < first[0], wall[0] < second[0]
        second = _select(nearer, first, _select(next_one, wall, second))
        first = _select(nearer, wall, first)
    return [Touch(body, ca.SX(1), end, plane, normal) for _, plane, normal in (first, second)]


def _along(ends: list[ca.SX], world: list[ca.SX], target: ca.SX) -> ca.SX:
    """Share of the way from the first end to the second that is nearest to `target`, unclamped."""
    if len(ends) == 1:
        return ca.SX(0)
    span = world[1] - world[0]
    return ca.dot(target - world[0], span) / ca.dot(span, span)


def _between(ends: list[ca.SX], s: ca.SX) -> ca.SX:
    return ends[0] if len(ends) == 1 else ends[0] + s * (ends[1] - ends[0])


def _on_disc(model: LinkageModel, pair: Pair, ends: list[ca.SX], p: Signals) -> Touch:
    center, radius = p[f"{pair.obstacle}.center"], p[f"{pair.obstacle}.radius"]
    world = [model.frames[pair.body].point(end) for end in ends]
    s = ca.fmin(ca.fmax(_along(ends, world, center), 0), 1)
    away = _between(world, s) - center
    normal = away / (ca.norm_2(away) + TINY)
    return Touch(pair.body, ca.SX(1), _between(ends, s), center + radius * normal, normal)


def _on_polygon(model: LinkageModel, pair: Pair, ends: list[ca.SX], p: Signals) -> list[Touch]:
    corners = p[f"{pair.obstacle}.corners"]
    world = [model.frames[pair.body].point(end) for end in ends]
    found = []
    for end, at in zip(ends, world, strict=True):
        plane, normal = _nearest_on_boundary(_edges(corners), at)
        found.append(Touch(pair.body, ca.SX(1), end, plane, normal))
    if len(ends) == 2:
        found.append(_nearest_corner(pair.body, ends, world, corners))
    return found


def _nearest_on_boundary(walls: list[tuple[ca.SX, ca.SX, ca.SX]], at: ca.SX) -> list[ca.SX]:
    """[point, normal] of the boundary nearest to a point: the edge's normal, or off a corner."""
    best: list[ca.SX] = []
    for a, b, outward in walls:
        s = ca.dot(at - a, b - a) / ca.dot(b - a, b - a)
        point = a + ca.fmin(ca.fmax(s, 0), 1) * (b - a)
        away = at - point
        distance = ca.norm_2(away)
        on_edge = ca.logic_and(s >= 0, s <= 1)
        normal = ca.if_else(on_edge, outward, away / (distance + TINY))
        this = [distance, point, normal]
        best = _select(distance < best[0], this, best) if best else this
    return best[1:]


def _nearest_corner(body: str, ends: list[ca.SX], world: list[ca.SX], corners: ca.SX) -> Touch:
    """The corner nearest to the inside of the segment, not active where none faces it."""
    far = ca.SX(1e9)
    best: list[ca.SX] = []
    for k in range(corners.shape[0]):
        corner = corners[k, :].T
        s = _along(ends, world, corner)
        inside = ca.logic_and(s > 0, s < 1)
        s = ca.fmin(ca.fmax(s, 0), 1)
        away = _between(world, s) - corner
        distance = ca.if_else(inside, ca.norm_2(away), far)
        this = [distance, inside, _between(ends, s), corner, away / (ca.norm_2(away) + TINY)]
        best = _select(distance < best[0], this, best) if best else this
    return Touch(body, *best[1:])
