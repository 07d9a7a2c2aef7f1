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

A place that would pass through its shape in one step is kept on the side where it entered, as long
as it is behind its line there (swept.py); the normals of such places are a state. Whoever detects
contacts that are held for a time t looks `ahead`, at the straight path of each place over t, and
what the acceleration a of a hand adds: it is active if its gap on the path comes below
margin + a t^2/2. If it moves by more than the margin, the geometry is that of where it first
touches, or else is nearest: a path that passes beside a shape is along the plane there. Otherwise
it is that of where the place is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

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
from hapticlink.components.contact.swept import closest_approach, entry, is_kept, support
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.bodies import counterclockwise
from hapticlink.components.specs.contacts import Contacts, Pair

COLUMNS = ("1", "m", "m", "m", "m", "1", "1")
"""Units of a row of the `contacts` port: active, point in the body (x, y), point of the plane
(x, y), normal of the plane (x, y), both in the other body or the world."""


ACCELERATION = 10.0
"""m/s^2, of a hand that reaches 1 m/s in 0.1 s."""


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


@dataclass(frozen=True)
class Ahead:
    """For how long (s) contacts are held, and the margin (m) of their gaps."""

    time: ca.SX
    margin: float

    @property
    def gap(self) -> ca.SX:
        """The gap (m) on the path up to which a place is active: what a hand may change of it."""
        return self.margin + ACCELERATION * self.time**2 / 2


def touches(
    model: LinkageModel,
    contacts: Contacts,
    p: Signals,
    kept: ca.SX | None = None,
    ahead: Ahead | None = None,
) -> list[Touch]:
    """Every place of every pair within reach, in the order of `broad_phase.near`. kept: a row of
    normals, or zeros, for each of `swept_places` (k x 2); None: none is kept."""
    touching: list[Touch] = []
    sides = iter([] if kept is None else ca.vertsplit(kept))
    for pair in near(model.linkage, contacts):
        body = _body(model, pair.body)
        if pair.kind == "enclosure":
            at_end = _in_corner if contacts.friction is None else _at_walls
            touching += [t for end in _rows(body) for t in at_end(model, pair.body, end, p, ahead)]
        else:
            places = _between(model, body, _obstacle(model, pair, p))
            touching += [place.touch(next(sides, None), ahead) for place in places]
    return touching


def swept_places(model: LinkageModel, contacts: Contacts, p: Signals) -> list[MovingPoint]:
    """The places of all pairs of shapes: all but those at the enclosure, which nothing passes."""
    return [
        place
        for pair in near(model.linkage, contacts)
        if pair.kind != "enclosure"
        for place in _between(model, _body(model, pair.body), _obstacle(model, pair, p))
    ]


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


def _at_walls(
    model: LinkageModel, body: str, end: ca.SX, p: Signals, ahead: Ahead | None
) -> list[Touch]:
    radius, point = model.p[f"{body}.radius"], model.frames[body].point(end)
    touching = []
    for a, _, outward in edges(p["enclosure.corners"]):
        least = _least_gap(model, ca.dot(point - a, -outward), ahead)
        touching.append(Touch(body, "ground", _is_met(least, radius, ahead), end, a, -outward))
    return touching


def _in_corner(
    model: LinkageModel, body: str, end: ca.SX, p: Signals, ahead: Ahead | None
) -> list[Touch]:
    radius, point = model.p[f"{body}.radius"], model.frames[body].point(end)
    walls = [
        [_least_gap(model, ca.dot(point - a, -outward), ahead), a, -outward]
        for a, _, outward in edges(p["enclosure.corners"])
    ]
    first, second = select(walls[0][0] < walls[1][0], walls[0] + walls[1], walls[1] + walls[0]), []
    first, second = first[:3], first[3:]
    for wall in walls[2:]:
        nearer, next_one = wall[0] < first[0], wall[0] < second[0]
        second = select(nearer, first, select(next_one, wall, second))
        first = select(nearer, wall, first)
    return [
        Touch(body, "ground", _is_met(least, radius, ahead), end, plane, n)
        for least, plane, n in (first, second)
    ]


def _least_gap(model: LinkageModel, gap: ca.SX, ahead: Ahead | None) -> ca.SX:
    """The smallest gap of a corner at a wall over the time `ahead`."""
    return gap + ca.fmin(0, model.rate(gap)) * ahead.time if ahead else gap


def _is_met(gap: ca.SX, radius: ca.SX, ahead: Ahead | None) -> ca.SX:
    return gap - radius < ahead.gap if ahead else ca.SX(1)


@dataclass(frozen=True)
class MovingPoint:
    """A point that moves by a core, both of shapes that can touch each other: x (m) in the frame of
    the core's body. core_first: the core belongs to the pair's first body, whose `Touch` has a
    point of the core, or else one of its plane; back: as in closest_points.py."""

    model: LinkageModel
    core: Shape
    corner: Shape
    local: ca.SX
    core_first: bool
    back: ca.SX | int = 0

    @cached_property
    def x(self) -> ca.SX:
        frames = self.model.frames
        return frames[self.core.body].local(frames[self.corner.body].point(self.local))

    @cached_property
    def _nearest(self) -> list[ca.SX]:
        """The core's nearest point and its normal there."""
        return _nearest(self.core, self.x, self.back)

    @property
    def _gap(self) -> ca.SX:
        """Distance from the core, negative inside."""
        point, normal = self._nearest
        return ca.dot(normal, self.x - point)

    @property
    def _reach(self) -> ca.SX:
        return ca.SX(self.core.radius + self.corner.radius)

    def entered(self, kept: ca.SX, d: ca.SX) -> ca.SX:
        """The normal on whose side the place is to be kept while it moves by d: the one on which it
        is kept already, where it touches, or where its path enters; 0 if it does not."""
        share = entry(self.core.corners, self.x, d, self._reach)
        _, later = _nearest(self.core, self.x + ca.fmin(share, 1) * d)
        _, normal = self._nearest
        entered = ca.if_else(self.is_inside, normal, ca.if_else(share <= 1, later, 0))
        return ca.if_else(self.keeps(kept), kept, entered)

    def keeps(self, kept: ca.SX) -> ca.SX:
        """Whether the place is kept on the side `kept`."""
        _, normal = self._nearest
        return is_kept(self.core.corners, self.x, kept, self._reach, normal)

    @property
    def is_inside(self) -> ca.SX:
        """Whether the shapes overlap here."""
        return self._gap < self._reach

    def touch(self, kept: ca.SX | None, ahead: Ahead | None) -> Touch:
        """kept: its normal (1 x 2), or None."""
        active, best = ca.SX(1), self._nearest
        if ahead:
            active, best = self._ahead(ahead)
        if kept is not None:
            n = kept.T
            off = ca.dot(n, self.x) - support(self.core.corners, n)
            keeps = self.keeps(n)
            best = select(keeps, [self.x - off * n, n], best)
            active = ca.logic_or(active, keeps)
        return self._placed(active, *best)

    def _ahead(self, ahead: Ahead) -> tuple[ca.SX, list[ca.SX]]:
        """Whether the place comes within the margin, and the core's nearest point and normal at the
        place's first touch in this time, or where it is nearest to the core."""
        corners, d = self.core.corners, self.model.rate(self.x) * ahead.time
        share = entry(corners, self.x, d, self._reach)
        end, normal = _nearest(self.core, self.x + d)
        gaps = self._gap, ca.dot(normal, self.x + d - end)
        least, nearest = closest_approach(corners, self.x, d, *gaps)
        meets = share <= 1
        at = ca.if_else(meets, share, nearest)
        later = [ca.logic_or(meets, least < self._reach + ahead.gap)]
        later += _nearest(self.core, self.x + at * d)
        now = [self._gap < self._reach + ahead.gap, *self._nearest]
        leaves = ca.logic_and(ca.sumsqr(d) > ahead.margin**2, ca.logic_not(self.is_inside))
        active, *there = select(leaves, later, now)
        return active, there

    def _placed(self, active: ca.SX, point: ca.SX, normal: ca.SX) -> Touch:
        """The contact at a point of the core, with its outward normal, both in its frame."""
        frame, ours, theirs = self.model.frames[self.core.body], self.core, self.corner
        outward = frame.rotation @ normal
        if not self.core_first:
            plane = frame.point(point) + ours.radius * outward
            return Touch(theirs.body, ours.body, active, self.local, plane, outward)
        plane = self.model.frames[theirs.body].point(self.local) - theirs.radius * outward
        return Touch(ours.body, theirs.body, active, point, plane, -outward)


def _between(model: LinkageModel, a: Shape, b: Shape) -> Iterator[MovingPoint]:
    """The places of two shapes: each corner of either core at the other core; of a point alone."""
    if b.corners.shape[0] > 1:
        for corner in _rows(a):
            yield MovingPoint(model, b, a, corner, core_first=False)
    if a.corners.shape[0] > 1 or b.corners.shape[0] == 1:
        frame, other = model.frames[a.body], model.frames[b.body]
        seen = [frame.local(other.point(corner)) for corner in _rows(b)]
        backs: list[ca.SX] = [ca.SX(0)] * len(seen)
        if a.corners.shape[0] == 2 and len(seen) > 2:
            backs = sunk_past(a.corners, ca.horzcat(*seen).T)
        for corner, back in zip(_rows(b), backs, strict=True):
            yield MovingPoint(model, a, b, corner, core_first=True, back=back)


def _nearest(shape: Shape, position: ca.SX, back: ca.SX | int = 0) -> list[ca.SX]:
    """Point and outward normal of a core that is nearest to a point of its frame."""
    corners = shape.corners
    if corners.shape[0] == 1:
        return nearest_on_point(corners.T, position)
    if corners.shape[0] == 2:
        return nearest_on_segment(corners, position, back)
    return nearest_on_boundary(edges(corners), position)
