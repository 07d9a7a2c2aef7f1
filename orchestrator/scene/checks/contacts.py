"""Checks [contacts] and the shapes of bodies: convex polygons, unique names, something to touch.
Each check yields (path in the file, message)."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hapticlink.components.contact.broad_phase import counterclockwise, edges
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.quantities import Point
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def check(scene: Scene) -> Iterator[Problem]:
    if scene.linkage:
        yield from _shapes(scene.linkage)
    limited = scene.linkage is not None and scene.linkage.limited
    if scene.controller and scene.controller.contact and not scene.contacts and not limited:
        message = "there is nothing to touch: add [contacts] or limits of a joint"
        yield ("controller", "contact"), message
    if scene.contacts is None:
        return
    contacts, here = scene.contacts, ("contacts",)
    if scene.linkage is None or all(b.radius is None for b in scene.linkage.body):
        yield here, "no body has a shape: give a [[linkage.body]] its radius"
    if not contacts.enclosure and not contacts.disc and not contacts.polygon:
        yield here, "there is nothing to touch: give an enclosure, a disc or a polygon"
    if contacts.detection == "graphics" and not scene.graphics:
        message = "there is no graphics rate: add [graphics], or take detection = 'haptics'"
        yield (*here, "detection"), message
    if contacts.friction is not None and not contacts.stiffness:
        yield (*here, "friction"), "a contact without stiffness cannot stick: give one"
    yield from _obstacles(contacts)


def _shapes(linkage: Linkage) -> Iterator[Problem]:
    for i, body in enumerate(linkage.body):
        if len(body.capsule) not in (1, 2) or len(set(body.capsule)) != len(body.capsule):
            yield ("linkage", "body", i, "capsule"), "two different points, or one for a disc"


def _obstacles(contacts: Contacts) -> Iterator[Problem]:
    here: Path = ("contacts",)
    if contacts.enclosure is not None:
        yield from _convex((*here, "enclosure"), contacts.enclosure)
    for i, polygon in enumerate(contacts.polygon):
        yield from _convex((*here, "polygon", i, "corners"), polygon.corners)
    names: set[str] = {"enclosure"}
    for kind in ("disc", "polygon"):
        for i, obstacle in enumerate(getattr(contacts, kind)):
            name = obstacle.name or f"{kind}{i + 1}"
            if name in names:
                yield (*here, kind, i, "name"), f"{name!r} is taken: name each obstacle once"
            names.add(name)


def _convex(path: Path, corners: tuple[Point, ...]) -> Iterator[Problem]:
    """Problems unless the polygon is convex: every corner turns left, by one turn in all."""
    if len(corners) < 3:
        yield path, f"{len(corners)} corners: a polygon has 3 or more"
        return
    around = edges(counterclockwise(corners))
    turned = 0.0
    for (a, b), (_, c) in zip(around, (*around[1:], around[0]), strict=True):
        first, then = (b[0] - a[0], b[1] - a[1]), (c[0] - b[0], c[1] - b[1])
        cross = first[0] * then[1] - first[1] * then[0]
        if cross <= 0:
            yield path, f"not convex at {b}: take a corner out, or split the polygon"
            return
        turned += math.atan2(cross, first[0] * then[0] + first[1] * then[1])
    if turned > 2 * math.pi + 1e-6:
        yield path, "the edges cross each other: list the corners in order"
