"""[contacts]: obstacles and contact parameters, as a scene writes them, in SI units."""

from __future__ import annotations

from dataclasses import dataclass
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
    """Obstacles that the links can touch, and the parameters of the contact force."""

    enclosure: tuple[Point, ...] | None = None
    """Corners of a convex polygon around the linkage."""
    disc: tuple[Disc, ...] = ()
    """Fixed discs."""
    polygon: tuple[Polygon, ...] = ()
    """Fixed convex polygons."""
    stiffness: LinearStiffness = 15000.0
    """k_contact of section B.6."""
    damping: LinearDamping = 300.0
    """b_contact of section B.6."""
    friction: Annotated[float, Quantity("1", ge=0)] | None = None
    """Coefficient of Coulomb friction, up to which contacts stick; by default there is none."""
    detection: Literal["graphics", "haptics"] = "graphics"
    """graphics: the virtual environment detects contacts, and their geometry is held between frames
    (the report's local model); haptics: the mechanism detects them at every evaluation."""
    margin: Annotated[float, Quantity("m", ge=0)] = 0.01
    """Gap up to which the virtual environment reports a contact."""
    broad_phase: bool = True
    """Whether to leave out pairs of a body and an obstacle that can never touch."""


@dataclass(frozen=True)
class Pair:
    """A body that can reach an obstacle, and the number of places where they can touch."""

    body: str
    kind: Literal["enclosure", "disc", "polygon"]
    index: int
    obstacle: str
    places: int


def pairs(linkage: Linkage, contacts: Contacts) -> tuple[Pair, ...]:
    """Every pair of a body with a shape and an obstacle.

    A capsule has these places: at the enclosure, either end at up to two walls (a corner), or with
    friction, whose deflections belong to walls, at all of them; at a disc, one; at a polygon,
    either end and one along its side.
    """
    walls = 2 if contacts.friction is None else len(contacts.enclosure or ())
    found = []
    for body in linkage.body:
        if body.radius is None:
            continue
        ends = len(body.capsule)
        if contacts.enclosure:
            found.append(Pair(body.name, "enclosure", 0, "enclosure", walls * ends))
        for i, disc in enumerate(contacts.disc):
            found.append(Pair(body.name, "disc", i, disc.name or f"disc{i + 1}", 1))
        for i, polygon in enumerate(contacts.polygon):
            name = polygon.name or f"polygon{i + 1}"
            found.append(Pair(body.name, "polygon", i, name, ends + (ends == 2)))
    return tuple(found)
