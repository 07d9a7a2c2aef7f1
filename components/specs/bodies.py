"""[[linkage.body]]: rigid bodies, their shapes, and the inertia of a shape of uniform density."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hapticlink.components.specs.quantities import (
    Length,
    Mass,
    MomentOfInertia,
    Place,
    Point,
    ProductOfInertia,
)

Moments = tuple[MomentOfInertia, MomentOfInertia, MomentOfInertia]
Inertias = tuple[
    MomentOfInertia,
    MomentOfInertia,
    MomentOfInertia,
    ProductOfInertia,
    ProductOfInertia,
    ProductOfInertia,
]
SAME = 1e-9
"""The distance (m) up to which a centre of mass is that of a shape."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body. With a shape it can touch obstacles and other bodies: a disc or a capsule (a
    `radius`), or a convex polygon (`corners`, which a `radius` rounds)."""

    name: str
    """Its name in joints, loops and points; not "ground"."""
    mass: Mass
    """Mass; may be 0 for a body in a loop that cannot move without other masses."""
    inertia: MomentOfInertia | Moments | Inertias = None  # type: ignore[assignment]  # of a shape
    """Moment of inertia about the centre of mass; by default that of its shape with uniform
    density, whose centroid is then the centre of mass. In space I_xx, I_yy, I_zz along the axes of
    the body's frame, and after these the entries I_xy, I_xz, I_yz of the tensor where they are not
    0; a single number holds about every axis."""
    center: Place | None = None
    """Centre of mass in the body's frame; by default its origin."""
    radius: Length | None = None
    """Radius of the body's shape; without one, and without corners, it touches nothing."""
    capsule: tuple[Point, ...] = ((0.0, 0.0),)
    """Ends of the axis of the body's shape, in its frame; one point for a disc."""
    corners: tuple[Point, ...] | None = None
    """Corners of a convex polygon in its frame, in place of a capsule, to which the radius adds."""

    def __post_init__(self) -> None:
        if self.inertia is not None:
            return
        if not self.shape:
            raise ValueError(f"body {self.name!r} has no shape: give its `inertia`")
        if self.center is not None and len(self.center) > 2:
            raise ValueError(f"body {self.name!r} has a shape of the plane: give its `inertia`")
        try:
            center, per_mass = uniform(self.shape, self.radius or 0.0)
        except OverflowError:
            raise ValueError(f"body {self.name!r}: its shape is too large (m)") from None
        if self.center is not None and math.dist(self.center, center) > SAME:
            raise ValueError(
                f"body {self.name!r}: center = {list(self.center)} is not that of its uniform "
                f"shape, {[round(x, 9) for x in center]}: give its `inertia` too, or leave out "
                "`center`"
            )
        object.__setattr__(self, "inertia", self.mass * per_mass)
        if center != (0.0, 0.0):
            object.__setattr__(self, "center", center)

    @property
    def inertia_tensor(self) -> NDArray[np.float64]:
        """Of the body in its own axes, (3, 3), kg.m2."""
        if not isinstance(self.inertia, tuple):
            return self.inertia * np.eye(3)
        tensor = np.diag(self.inertia[:3])
        for (i, j), entry in zip(((0, 1), (0, 2), (1, 2)), self.inertia[3:], strict=False):
            tensor[i, j] = tensor[j, i] = entry
        return tensor

    @property
    def moments(self) -> tuple[float, ...]:
        """Its principal moments of inertia, the smallest first; one where a single number holds
        about every axis and in the plane."""
        if not isinstance(self.inertia, tuple):
            return (self.inertia,)
        return tuple(np.linalg.eigvalsh(self.inertia_tensor).tolist())

    @property
    def shape(self) -> tuple[Point, ...]:
        """Corners of what the radius rounds: of a point, a segment or a polygon, counterclockwise;
        none if it touches nothing."""
        if self.corners is not None:
            return counterclockwise(self.corners)
        return () if self.radius is None else self.capsule


def edges(corners: tuple[Point, ...]) -> list[tuple[Point, Point]]:
    return list(zip(corners, (*corners[1:], *corners[:1]), strict=True))


def counterclockwise(corners: tuple[Point, ...]) -> tuple[Point, ...]:
    """The corners in counterclockwise order, with the inside on the left of every edge."""
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in edges(corners))
    return corners if area >= 0 else corners[::-1]


def uniform(corners: tuple[Point, ...], radius: float) -> tuple[Point, float]:
    """Centroid (m) and moment of inertia about it by mass (m2) of the points within `radius` of a
    convex polygon, a segment or a point.

    The shape consists of triangles about the origin, a rectangle on each edge, and a sector of the
    circle at each corner, whose angles are those by which the edges turn. Raises ValueError for a
    shape without area.
    """
    parts = []  # area, centroid, polar second moment about the centroid
    around = edges(corners)
    for (px, py), (qx, qy) in around:
        dx, dy = qx - px, qy - py
        length = math.hypot(dx, dy)
        area = (px * qy - qx * py) / 2
        middle = ((px + qx) / 3, (py + qy) / 3)
        # sum of the squared sides over 36 (Steiner's formula for a triangle)
        sides = px**2 + py**2 + qx**2 + qy**2 + length**2
        parts.append((area, middle, area * sides / 36))
        if length and radius:
            out = (dy / length * radius / 2, -dx / length * radius / 2)
            middle = ((px + qx) / 2 + out[0], (py + qy) / 2 + out[1])
            area = length * radius
            parts.append((area, middle, area * (length**2 + radius**2) / 12))
    for (p, q), (_, r) in zip(around, (*around[1:], around[0]), strict=True) if radius else ():
        first = math.atan2(q[1] - p[1], q[0] - p[0])
        then = math.atan2(r[1] - q[1], r[0] - q[0])
        turn = (then - first) % (2 * math.pi) if len(corners) > 1 else 2 * math.pi
        area = radius**2 * turn / 2
        sector = turn and len(corners) > 1
        away = 4 * radius * math.sin(turn / 2) / (3 * turn) if sector else 0.0
        angle = first - math.pi / 2 + turn / 2
        middle = (q[0] + away * math.cos(angle), q[1] + away * math.sin(angle))
        parts.append((area, middle, area * (radius**2 / 2 - away**2)))
    total = math.fsum(area for area, _, _ in parts)
    if math.isinf(total * total):
        raise OverflowError
    if not total > 0:
        raise ValueError("a shape without area has no uniform density: give the body's `inertia`")
    x, y = (math.fsum(a * middle[i] for a, middle, _ in parts) / total for i in (0, 1))
    moments = (own + a * ((c[0] - x) ** 2 + (c[1] - y) ** 2) for a, c, own in parts)
    return (x, y), math.fsum(moments) / total
