"""How deep bodies are in what they touch, and how deep is meaningful.

Beyond the middle of the thinner one of two shapes the nearest side is another one than that on
which they met, which is known only where they were seen to meet (swept.py), and a corner that has
sunk past the axis of a capsule can lose or gain its spring (detection.py), and with it energy. Two
polygons that go right through each other, and shapes that cross with no corner in the other, have
no deep corner that shows it: `overlaps` finds them by separating axes. The walls of the enclosure
are half planes, in which any depth is meaningful.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.component import Signals
from hapticlink.components.contact.broad_phase import near
from hapticlink.components.contact.contact_forces import detection_parameters, gap
from hapticlink.components.contact.detection import touches
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import body_parameters
from hapticlink.components.specs.bodies import counterclockwise, edges
from hapticlink.components.specs.contacts import Contacts, Pair
from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.quantities import Point


def middle(linkage: Linkage, contacts: Contacts, pair: Pair) -> float:
    """Half the smallest width (m) of the thinner one of two shapes; inf at the enclosure."""
    if pair.kind == "enclosure":
        return math.inf
    bodies = {b.name: b for b in linkage.body}
    body = bodies[pair.body]
    shapes = [(body.shape, body.radius or 0.0)]
    if pair.kind == "body":
        other = bodies[pair.obstacle]
        shapes.append((other.shape, other.radius or 0.0))
    elif pair.kind == "disc":
        shapes.append(((), contacts.disc[pair.index].radius))
    else:
        shapes.append((contacts.polygon[pair.index].corners, 0.0))
    return min(_width(corners) / 2 + radius for corners, radius in shapes)


def _width(corners: tuple[Point, ...]) -> float:
    """The smallest distance of two parallel lines with a convex polygon between them, 0 for a
    segment or a point: one of them is along an edge."""
    if len(corners) < 3:
        return 0.0
    points, widths = np.array(corners), []
    for a, b in edges(corners):
        across = np.array([a[1] - b[1], b[0] - a[0]]) / math.dist(a, b)
        widths.append(float(np.ptp(points @ across)))
    return min(widths)


def depths(
    linkage: Linkage, contacts: Contacts, q: Sequence[Sequence[float]] | NDArray[np.float64]
) -> Iterator[tuple[Pair, NDArray[np.float64]]]:
    """Each pair that can touch, and its depth (m), negative where it is apart, (k,), at joint
    coordinates q (k, n)."""
    p = Signals("p", [*body_parameters(linkage), *detection_parameters(linkage, contacts)])
    model = LinkageModel.symbolic(linkage, p)
    gaps = ca.vertcat(*(gap(model, touch) for touch in touches(model, contacts, p)))
    function, rows = ca.Function("gaps", [model.q, p.vector], [gaps]), np.atleast_2d(q)
    gap_rows = np.array(function(rows.T, np.tile(p.starts, (len(rows), 1)).T)).T
    first = 0
    for pair in near(linkage, contacts):
        last = first + pair.places
        yield pair, -gap_rows[:, first:last].min(axis=1)
        first = last


def overlaps(
    linkage: Linkage, contacts: Contacts, q: NDArray[np.float64]
) -> Iterator[tuple[Pair, NDArray[np.float64]]]:
    """Each pair of segments or polygons that can touch, and the length (m) of the shortest shift
    that parts them, (k,), at joint coordinates q (k, n); -inf where their cores are apart (Ericson,
    Real-Time Collision Detection, section 5.2.1)."""
    p = Signals("p", body_parameters(linkage))
    model = LinkageModel.symbolic(linkage, p)
    bodies = {b.name: b for b in linkage.body}

    def placed(name: str) -> NDArray[np.float64]:
        """The corners of a body in the world, (k, corners, 2)."""
        frame = model.frames[name]
        corners = [frame.point(ca.SX(ca.DM(point))) for point in bodies[name].shape]
        in_world = ca.Function("corners", [model.q, p.vector], [ca.vertcat(*corners)])
        stacked = np.array(in_world(q.T, np.tile(p.starts, (len(q), 1)).T))
        return stacked.T.reshape(len(q), -1, 2)

    for pair in near(linkage, contacts):
        if pair.kind == "body":
            other: tuple[Point, ...] = bodies[pair.obstacle].shape
        else:
            other = contacts.polygon[pair.index].corners if pair.kind == "polygon" else ()
        if min(len(other), len(bodies[pair.body].shape)) > 1:
            fixed = np.tile(counterclockwise(other), (len(q), 1, 1))
            both = placed(pair.body), placed(pair.obstacle) if pair.kind == "body" else fixed
            distance = np.maximum(_distance(*both), _distance(*both[::-1]))
            names = (pair.body, pair.obstacle) if pair.kind == "body" else (pair.body,)
            radii = sum(bodies[name].radius or 0.0 for name in names)
            yield pair, np.where(distance < 0, radii - distance, -math.inf)


def _distance(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest distance (k,) of the corners `other` from an edge of `one`, along its normal."""
    span = np.roll(one, -1, axis=1) - one
    outward = np.stack([span[..., 1], -span[..., 0]], axis=-1)
    outward /= np.linalg.norm(span, axis=-1, keepdims=True)
    heights = np.einsum("kei,kci->kec", outward, other) - np.sum(outward * one, -1)[..., None]
    distance: NDArray[np.float64] = heights.min(axis=2).max(axis=1)
    return distance
