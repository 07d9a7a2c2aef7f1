"""Checks [contacts] and the shapes of bodies: convex polygons, unique names, something to touch.
Each check yields (path in the file, message)."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hapticlink.components.specs.bodies import counterclockwise, edges
from hapticlink.components.specs.contacts import Contacts, pairs
from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.quantities import Point
from hapticlink.orchestrator.scene.scene import Scene
from hapticlink.orchestrator.scene.toml_keys import Path, Problem


def check_contacts(scene: Scene) -> Iterator[Problem]:
    if scene.linkage:
        yield from _shapes(scene.linkage)
    limited = scene.linkage is not None and scene.linkage.limited
    if scene.controller and scene.controller.contact and not scene.contacts and not limited:
        message = "there is nothing to touch: add [contacts] or limits of a joint"
        yield ("controller", "contact"), message
    if scene.contacts is None or (scene.linkage and scene.linkage.dimension > 2):
        return  # the latter are refused as a whole, by checks/space.py
    contacts, here = scene.contacts, ("contacts",)
    if scene.linkage is None or not any(b.shape for b in scene.linkage.body):
        yield here, "no body has a shape: give a [[linkage.body]] its radius or corners"
    elif not pairs(scene.linkage, contacts):
        message = "an enclosure, a disc, a polygon, or two bodies that touch each other (`bodies`)"
        yield here, f"there is nothing to touch: give {message}"
    if contacts.detection == "graphics" and not scene.graphics:
        message = "there is no graphics rate: add [graphics], or take detection = 'haptics'"
        yield (*here, "detection"), message
    pulled = scene.graphics and scene.graphics.sync == "operational"
    if pulled and contacts.detection == "graphics" and scene.linkage and scene.linkage.objects:
        name = min(scene.linkage.objects)
        message = f"nothing pulls the copy of {name!r} along: take 'exact' or 'joint'"
        yield ("graphics", "sync"), message
    if contacts.friction is not None and not contacts.stiffness:
        yield (*here, "friction"), "a contact without stiffness cannot stick: give one"
    bodies = scene.linkage.body if scene.linkage else ()
    yield from _obstacles(contacts, {b.name for b in bodies})


def _shapes(linkage: Linkage) -> Iterator[Problem]:
    for i, body in enumerate(linkage.body):
        path: Path = ("linkage", "body", i)
        if len(body.capsule) not in (1, 2) or len(set(body.capsule)) != len(body.capsule):
            yield (*path, "capsule"), "two different points, or one for a disc"
        if body.corners is not None:
            yield from _convex((*path, "corners"), body.corners)
            if body.capsule != ((0.0, 0.0),):
                yield (*path, "capsule"), "the shape is a polygon already: leave out one of them"


def _obstacles(contacts: Contacts, bodies: set[str]) -> Iterator[Problem]:
    here: Path = ("contacts",)
    if contacts.enclosure is not None:
        yield from _convex((*here, "enclosure"), contacts.enclosure)
    for i, polygon in enumerate(contacts.polygon):
        yield from _convex((*here, "polygon", i, "corners"), polygon.corners)
    names: set[str] = {"enclosure", *bodies}
    for kind in ("disc", "polygon"):
        for i, obstacle in enumerate(getattr(contacts, kind)):
            name = obstacle.name or f"{kind}{i + 1}"
            if name in names:
                message = f"{name!r} is taken: name each obstacle and body once"
                yield (*here, kind, i, "name"), message
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
