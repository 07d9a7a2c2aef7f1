"""Swept tests: where the straight path of a point meets a shape, and on which side of it the point
is kept that has passed through between two looks.

    entry   the smallest s in [0, 1] with |x + s d - y| <= r for a point y of the core: where the
            path meets an edge moved outward by r, beside it, or the circle of radius r around a
            corner (Ericson, Real-Time Collision Detection (2005), section 5.3)
    kept    a normal n, on whose side the point was last. The core is behind its supporting line
            n . y = max n . corner, from which the point is pushed back as long as it is behind it
            and the core's nearest side is an opposite one.

Without memory a point past the middle of a thin shape is pushed out on the other side. Corners are
counterclockwise, k x 2 (m), of a point (k = 1), a segment (2) or a polygon.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.contact.closest_points import TINY, edges, select

NEVER = 1e9
"""The share of a path that meets nothing."""
UNIT = 0.5
"""The square of the length from which on a normal is one: that of no normal is 0."""


def entry(corners: ca.SX, x: ca.SX, d: ca.SX, r: ca.SX) -> ca.SX:
    """The share of the path from x along d at which it comes within r of a core from outside, NEVER
    where it does not; of a path that begins within r of the boundary it may be any."""
    first = ca.SX(NEVER)

    def meet(share: ca.SX, meets: ca.SX) -> ca.SX:
        within = ca.logic_and(meets, ca.logic_and(share >= 0, share <= 1))
        return ca.fmin(first, ca.if_else(within, share, NEVER))

    for k in range(corners.shape[0]):
        away = x - corners[k, :].T
        closing, length = -ca.dot(away, d), ca.sumsqr(d)
        under = closing**2 - length * (ca.sumsqr(away) - r**2)
        meets = ca.logic_and(under >= 0, ca.logic_and(closing > 0, length > TINY))
        first = meet((closing - ca.sqrt(ca.fmax(under, 0))) / (length + TINY), meets)
    for a, b, outward in edges(corners) if corners.shape[0] > 1 else ():
        fall, span = -ca.dot(outward, d), b - a
        share = (ca.dot(outward, x - a) - r) / ca.if_else(fall > 0, fall, 1)
        along = ca.dot(x + share * d - a, span)
        beside = ca.logic_and(along >= 0, along <= ca.sumsqr(span))
        first = meet(share, ca.logic_and(fall > 0, beside))
    return first


def closest_approach(
    corners: ca.SX, x: ca.SX, d: ca.SX, begin: ca.SX, end: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """The smallest distance from a core on the path from x along d, which does not meet it, and its
    share of the path: at one of the ends, whose distances are given, or at a corner."""
    least, share = select(end < begin, [end, ca.SX(1)], [begin, ca.SX(0)])
    for k in range(corners.shape[0]):
        ahead = corners[k, :].T - x
        s = ca.fmin(ca.fmax(ca.dot(ahead, d) / (ca.sumsqr(d) + TINY), 0), 1)
        distance = ca.norm_2(ahead - s * d)
        least, share = select(distance < least, [distance, s], [least, share])
    return least, share


def support(corners: ca.SX, n: ca.SX) -> ca.SX:
    """The largest n . y of a core."""
    return ca.mmax(corners @ n)


def is_kept(corners: ca.SX, x: ca.SX, n: ca.SX, r: ca.SX, nearest: ca.SX) -> ca.SX:
    """Whether a point x at which the core's nearest normal is `nearest` is kept on the side n."""
    behind = ca.dot(n, x) - support(corners, n) < r
    opposite = ca.logic_and(ca.dot(n, nearest) < 0, ca.sumsqr(n) > UNIT)
    return ca.logic_and(behind, opposite)
