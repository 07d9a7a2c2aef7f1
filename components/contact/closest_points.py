"""Closest points and separating axes of points, segments and convex polygons, with bounded work.

Ericson, Real-Time Collision Detection (2005), sections 5.1.2, 5.1.9 and 5.2.1. Corners are
counterclockwise, k x 2 (m).
"""

from __future__ import annotations

import casadi as ca

TINY = 1e-300


def edges(corners: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX]]:
    """Start, end and outward normal (to the right) of each edge."""
    number = corners.shape[0]
    found = []
    for k in range(number):
        a, b = corners[k, :].T, corners[(k + 1) % number, :].T
        span = b - a
        found.append((a, b, ca.vertcat(span[1], -span[0]) / ca.norm_2(span)))
    return found


def select(condition: ca.SX, one: list[ca.SX], other: list[ca.SX]) -> list[ca.SX]:
    return [ca.if_else(condition, a, b) for a, b in zip(one, other, strict=True)]


def along(ends: list[ca.SX], world: list[ca.SX], target: ca.SX) -> ca.SX:
    """Parameter s of the point on the line from the first end (0) to the second (1) that is nearest
    to `target`, not clamped."""
    if len(ends) == 1:
        return ca.SX(0)
    span = world[1] - world[0]
    return ca.dot(target - world[0], span) / ca.dot(span, span)


def between(ends: list[ca.SX], s: ca.SX) -> ca.SX:
    return ends[0] if len(ends) == 1 else ends[0] + s * (ends[1] - ends[0])


def nearest_on_boundary(walls: list[tuple[ca.SX, ca.SX, ca.SX]], at: ca.SX) -> list[ca.SX]:
    """The boundary's point nearest to a given one, and its normal: that of the edge, or from a
    corner to the given point."""
    best: list[ca.SX] = []
    for a, b, outward in walls:
        s = ca.dot(at - a, b - a) / ca.dot(b - a, b - a)
        point = a + ca.fmin(ca.fmax(s, 0), 1) * (b - a)
        away = at - point
        distance = ca.norm_2(away)
        on_edge = ca.logic_and(s >= 0, s <= 1)
        normal = ca.if_else(on_edge, outward, away / (distance + TINY))
        this = [distance, point, normal]
        best = select(distance < best[0], this, best) if best else this
    return best[1:]


def way_out(
    world: list[ca.SX], corners: ca.SX, side: ca.SX, heights: list[ca.SX]
) -> tuple[ca.SX, ca.SX]:
    """Distance and direction of the separating axis along which a segment is farthest from a convex
    polygon, negative where they overlap (Ericson, section 5.2.1)."""
    best = [-ca.mmax(ca.vertcat(*heights)), -side]
    over = ca.mmin(ca.vertcat(*heights))
    best = select(over > best[0], [over, side], best)
    for a, _, outward in edges(corners):
        least = ca.fmin(*(ca.dot(at - a, outward) for at in world))
        best = select(least > best[0], [least, outward], best)
    return best[0], best[1]
