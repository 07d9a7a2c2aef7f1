"""What a scene can say of contacts, with every default. SI units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hapticlink.components.specs.linkage import Linkage, Point


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A fixed disc: centre and radius (m)."""

    center: Point
    radius: float
    name: str | None = None


@dataclass(frozen=True, kw_only=True)
class Polygon:
    """A fixed convex polygon by its corners (m), in either sense."""

    corners: tuple[Point, ...]
    name: str | None = None


@dataclass(frozen=True, kw_only=True)
class Contacts:
    """What the links can touch, and how hard it is.

    enclosure: corners (m) of a rigid convex polygon with the linkage inside. stiffness (N/m) and
    damping (N.s/m) are k_contact and b_contact of section B.6. detection "graphics" finds the
    contact geometry in the virtual environment and holds it between frames (the report's local
    model), for gaps up to `margin` (m); "haptics" finds it in the mechanism at every evaluation.
    broad_phase leaves out the pairs of a body and an obstacle that it can never reach.
    """

    enclosure: tuple[Point, ...] | None = None
    disc: tuple[Disc, ...] = ()
    polygon: tuple[Polygon, ...] = ()
    stiffness: float = 15000.0
    damping: float = 300.0
    detection: Literal["graphics", "haptics"] = "graphics"
    margin: float = 0.01
    broad_phase: bool = True


@dataclass(frozen=True)
class Pair:
    """A body that can reach an obstacle, and the number of places where they can touch."""

    body: str
    kind: Literal["enclosure", "disc", "polygon"]
    index: int
    obstacle: str
    places: int


def pairs(linkage: Linkage, contacts: Contacts) -> tuple[Pair, ...]:
    """Every body with a shape against every obstacle.

    A capsule touches the enclosure with either end at up to two walls (a corner); a disc once; a
    polygon with either end and along its side.
    """
    found = []
    for body in linkage.body:
        if body.radius is None:
            continue
        ends = len(body.capsule)
        if contacts.enclosure:
            found.append(Pair(body.name, "enclosure", 0, "enclosure", 2 * ends))
        for i, disc in enumerate(contacts.disc):
            found.append(Pair(body.name, "disc", i, disc.name or f"disc{i + 1}", 1))
        for i, polygon in enumerate(contacts.polygon):
            name = polygon.name or f"polygon{i + 1}"
            found.append(Pair(body.name, "polygon", i, name, ends + (ends == 2)))
    return tuple(found)
