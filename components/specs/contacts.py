"""[contacts]: obstacles and contact parameters, as a scene writes them, in SI units."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Annotated, Literal

from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.quantities import (
    Length,
    LinearDamping,
    LinearStiffness,
    Point,
    Quantity,
)


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A fixed disc."""

    center: Point
    """Its centre."""
    radius: Length
    """Its radius."""
    name: str | None = None
    """Its name in messages and FMU parameters; by default disc1, disc2, ..."""


@dataclass(frozen=True, kw_only=True)
class Polygon:
    """A fixed convex polygon."""

    corners: tuple[Point, ...]
    """Its corners, three or more, in either sense of rotation."""
    name: str | None = None
    """Its name in messages and FMU parameters; by default polygon1, polygon2, ..."""


@dataclass(frozen=True, kw_only=True)
class Contacts:
    """What bodies can touch, and the parameters of the contact force."""

    enclosure: tuple[Point, ...] | None = None
    """Corners of a convex polygon around the linkage."""
    disc: tuple[Disc, ...] = ()
    """Fixed discs."""
    polygon: tuple[Polygon, ...] = ()
    """Fixed convex polygons."""
    bodies: Literal["free", "all", "none"] = "free"
    """Bodies that touch each other. free: each on a free joint and in no loop touches every other
    body; all: any two that no joint connects; none."""
    stiffness: LinearStiffness = 15000.0
    """k_contact of section B.6."""
    damping: LinearDamping = 300.0
    """b_contact of section B.6."""
    friction: Annotated[float, Quantity("1", ge=0)] | None = None
    """Coefficient of Coulomb friction, up to which contacts stick; by default there is none.
    Changes between sticking and sliding are accurate to second order in the step."""
    detection: Literal["graphics", "haptics"] = "graphics"
    """graphics: the virtual environment detects contacts, and their geometry is held between frames
    (the report's local model); haptics: the mechanism detects them at every evaluation."""
    margin: Annotated[float, Quantity("m", ge=0)] = 0.01
    """Gap up to which the virtual environment reports a contact, on the path that it foresees."""
    broad_phase = True
    """Whether pairs that can never touch are left out."""


@dataclass(frozen=True, kw_only=True)
class ContactsOfAllPairs(Contacts):
    """Contacts with the pairs that can never touch, too."""

    broad_phase: bool = False
    """A field, so that settings that differ in it alone have FMUs of their own."""


@dataclass(frozen=True)
class Pair:
    """A body, an obstacle or another body that it can reach, and the number of places where they
    can touch."""

    body: str
    kind: Literal["enclosure", "disc", "polygon", "body"]
    index: int
    obstacle: str
    places: int


def pairs(linkage: Linkage, contacts: Contacts) -> tuple[Pair, ...]:
    """Every pair of a body with a shape and an obstacle, and of two bodies that touch each other.

    They have these places: at the enclosure, each corner of the body's shape at up to two walls (a
    corner), or with friction, whose deflections belong to walls, at all of them; else each corner
    of either shape at the other shape, but only one place if one of them is a disc.
    """
    walls = 2 if contacts.friction is None else len(contacts.enclosure or ())
    shaped = [(i, body) for i, body in enumerate(linkage.body) if body.shape]
    pairs = []
    for _, body in shaped:
        corners = len(body.shape)
        if contacts.enclosure:
            pairs.append(Pair(body.name, "enclosure", 0, "enclosure", walls * corners))
        for i, disc in enumerate(contacts.disc):
            pairs.append(Pair(body.name, "disc", i, disc.name or f"disc{i + 1}", 1))
        for i, polygon in enumerate(contacts.polygon):
            name = polygon.name or f"polygon{i + 1}"
            places = _places(corners, len(polygon.corners))
            pairs.append(Pair(body.name, "polygon", i, name, places))
    for (_, first), (i, second) in combinations(shaped, 2):
        if _touch(linkage, contacts, {first.name, second.name}):
            places = _places(len(first.shape), len(second.shape))
            pairs.append(Pair(first.name, "body", i, second.name, places))
    return tuple(pairs)


def _places(corners: int, others: int) -> int:
    return 1 if 1 in (corners, others) else corners + others


def _touch(linkage: Linkage, contacts: Contacts, both: set[str]) -> bool:
    """Whether two bodies touch each other."""
    joined = [{j.parent, j.child} for j in linkage.joint if not j.kind.free]
    if contacts.bodies == "none" or both in joined:
        return False
    if contacts.bodies == "free":
        return bool(both & linkage.free)
    return both not in [set(loop.bodies) for loop in linkage.loop]
