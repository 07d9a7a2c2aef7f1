"""The geometry of a scene's mechanism, which every drawing of it shares: outlines of bodies and
what is attached to them, each point in the frame of its body, in m."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Body, Linkage

Point = Sequence[float]
ORIGIN = (0.0, 0.0)
Points = NDArray[np.float64]
"""x, y of points, (k, 2)."""
BODIES = ("#4477aa", "#66ccee", "#228833", "#ccbb44", "#ee6677", "#aa3377")
"""The bright scheme of P. Tol, which colour-blind readers can tell apart."""
ROUND = np.exp(2j * np.pi * np.arange(48) / 48)
"""Corners of the circle with radius 1 that a disc is drawn as."""


def attached(linkage: Linkage, body: str) -> Iterator[Point]:
    """The points at which a body has its joints, closures and operational points."""
    for joint in linkage.joint:
        if joint.child == body:
            yield joint.at_child or ORIGIN
        if joint.parent == body and joint.type != "free":
            yield joint.at_parent or ORIGIN
    for loop in linkage.loop:
        yield from (
            at or ORIGIN for name, at in zip(loop.bodies, loop.at, strict=True) if name == body
        )
    for point in (linkage.operational_point, *linkage.point):
        if point.body == body:
            yield point.at or ORIGIN


def outline(points: Sequence[Point | Points] | Points) -> Points:
    """The corners of the convex hull of points, (k, 2): two for points on a line, one for a single
    point."""
    found = np.unique(np.round(np.array(points, float), 9), axis=0)
    if len(found) <= 2:
        return found
    _, sizes, (direction, _) = np.linalg.svd(found - found.mean(axis=0), full_matrices=False)
    if sizes[1] > 1e-6 * sizes[0]:
        return _hull(found)
    along = found @ direction
    return found[[along.argmin(), along.argmax()]]


def contact_shape(body: Body) -> Points:
    """The outline of what a body touches with, (k, 2): the hull of discs at its corners."""
    disc = np.column_stack([ROUND.real, ROUND.imag]) * (body.radius or 0.0)
    return outline(np.vstack([at + disc for at in np.array(body.shape)]))


def geometry(linkage: Linkage, contacts: Contacts | None) -> dict[str, Any]:
    """All of a mechanism that a drawing shows, as JSON has it: `bodies` with their outlines, and
    `joints`, `loops`, `springs` and `points` as places, a body's name with a point of it."""
    return {
        "bodies": [
            {
                "name": body.name,
                "color": BODIES[i % len(BODIES)],
                "outline": outline(
                    [*attached(linkage, body.name)] or [body.center or ORIGIN]
                ).tolist(),
                "shape": contact_shape(body).tolist() if body.shape else [],
                "center": body.center or ORIGIN,
            }
            for i, body in enumerate(linkage.body)
        ],
        "joints": [
            {"type": j.type, "axis": j.axis or 0.0, "at": (j.parent, j.at_parent or ORIGIN)}
            | {"child": (j.child, j.at_child or ORIGIN), "ground": j.parent == "ground"}
            for j in linkage.joint
            if j.type != "free"
        ],
        "loops": [
            {"type": loop.type, "axis": loop.axis or 0.0, "at": (loop.bodies[0], loop.at[0])}
            | {"second": (loop.bodies[1], loop.at[1]), "ground": "ground" in loop.bodies}
            for loop in linkage.loop
        ],
        "springs": [[*zip(s.bodies, s.at, strict=True)] for s in linkage.spring],
        "points": [(p.body, p.at or ORIGIN) for p in (linkage.operational_point, *linkage.point)],
        "discs": [(d.center, d.radius) for d in contacts.disc] if contacts else [],
        "polygons": [p.corners for p in contacts.polygon] if contacts else [],
        "enclosure": contacts.enclosure if contacts and contacts.enclosure else [],
    }


def _hull(points: Points) -> Points:
    """The corners of the convex hull of points that are sorted by x and then y, anticlockwise, by
    Andrew's monotone chain (Information Processing Letters 9, 1979, 216). scipy.spatial, which has
    one, takes as long to load as a figure to draw."""

    def chain(ordered: Points) -> list[Points]:
        kept: list[Points] = []
        for point in ordered:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], point) <= 0:
                kept.pop()
            kept.append(point)
        return kept[:-1]

    return np.array(chain(points) + chain(points[::-1]))


def _turn(a: Points, b: Points, c: Points) -> float:
    """Twice the area of the triangle a, b, c, positive where it turns anticlockwise."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
