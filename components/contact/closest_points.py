"""Closest points and separating axes of points, segments and convex polygons, with bounded work.

Ericson, Real-Time Collision Detection (2005), sections 5.1.2, 5.1.9 and 5.2.1. Corners are
counterclockwise, k x 2 (m), of a point (k = 1), a segment (2) or a polygon.
"""

from __future__ import annotations

import casadi as ca

TINY = 1e-300


def edges(corners: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX]]:
    """Start, end and outward normal (to the right) of each edge."""
    number = corners.shape[0]
    sides = []
    for k in range(number):
        a, b = corners[k, :].T, corners[(k + 1) % number, :].T
        span = b - a
        sides.append((a, b, ca.vertcat(span[1], -span[0]) / ca.norm_2(span)))
    return sides


def select(condition: ca.SX, one: list[ca.SX], other: list[ca.SX]) -> list[ca.SX]:
    return [ca.if_else(condition, a, b) for a, b in zip(one, other, strict=True)]


def nearest_on_point(point: ca.SX, position: ca.SX) -> list[ca.SX]:
    """A point, and the direction from it to a given one; any if they coincide."""
    away = position - point
    distance = ca.norm_2(away)
    return [point, ca.if_else(distance > 0, away / (distance + TINY), ca.SX([0.0, 1.0]))]


def nearest_on_segment(ends: ca.SX, position: ca.SX, back: ca.SX | int = 0) -> list[ca.SX]:
    """The segment's point nearest to a given one, and the normal there: of the segment on that
    side, or to the right (back = 1) or left (-1) of it; or from an end to the given point."""
    a, b = ends[0, :].T, ends[1, :].T
    span = b - a
    right = ca.vertcat(span[1], -span[0]) / ca.norm_2(span)
    s = ca.dot(position - a, span) / ca.dot(span, span)
    point = a + ca.fmin(ca.fmax(s, 0), 1) * span
    away = position - point
    side = ca.if_else(ca.dot(away, right) >= 0, 1, -1)
    side = ca.if_else(back == 0, side, back)
    on_segment = ca.logic_and(s >= 0, s <= 1)
    return [point, ca.if_else(on_segment, side * right, away / (ca.norm_2(away) + TINY))]


def nearest_on_boundary(walls: list[tuple[ca.SX, ca.SX, ca.SX]], position: ca.SX) -> list[ca.SX]:
    """The boundary's point nearest to a given one, and its normal: that of the edge, or from a
    corner to the given point."""
    best: list[ca.SX] = []
    for a, b, outward in walls:
        s = ca.dot(position - a, b - a) / ca.dot(b - a, b - a)
        point = a + ca.fmin(ca.fmax(s, 0), 1) * (b - a)
        away = position - point
        distance = ca.norm_2(away)
        on_edge = ca.logic_and(s >= 0, s <= 1)
        normal = ca.if_else(on_edge, outward, away / (distance + TINY))
        this = [distance, point, normal]
        best = select(distance < best[0], this, best) if best else this
    return best[1:]


def sunk_past(ends: ca.SX, corners: ca.SX) -> list[ca.SX]:
    """For each corner of a polygon that a segment cuts: 1 or -1 if the corner has to go back to the
    right or left of the segment, since it lies beyond it by no more than the shortest way out; 0
    otherwise."""
    a, b = ends[0, :].T, ends[1, :].T
    span = b - a
    right = ca.vertcat(span[1], -span[0]) / ca.norm_2(span)
    heights = [ca.dot(right, corners[k, :].T - a) for k in range(corners.shape[0])]
    depth, outward = _way_out([a, b], corners, right, heights)
    back = ca.if_else(ca.dot(outward, right) >= 0, -1, 1)
    return [ca.if_else(ca.logic_and(depth < 0, depth <= back * h), back, 0) for h in heights]


def _way_out(
    ends: list[ca.SX], corners: ca.SX, right: ca.SX, heights: list[ca.SX]
) -> tuple[ca.SX, ca.SX]:
    """Distance and direction of the separating axis along which a segment is farthest from a convex
    polygon, negative where they overlap (Ericson, section 5.2.1)."""
    best = [ca.mmin(ca.vertcat(*heights)), -right]
    under = -ca.mmax(ca.vertcat(*heights))
    best = select(under > best[0], [under, right], best)
    for a, _, outward in edges(corners):
        least = ca.fmin(*(ca.dot(end - a, outward) for end in ends))
        best = select(least > best[0], [least, outward], best)
    return best[0], best[1]
