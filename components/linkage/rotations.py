"""Rotations in space, as matrices R that take a body's coordinates to its parent's.

About a constant unit axis a by an angle (Rodrigues), with K = [a] its cross product:

    R = a a' + cos(angle) (1 - a a') + sin(angle) K

A ball has three coordinates q = 4 tan(angle/4) a, four times the modified Rodrigues parameters
sigma, with s = sigma' sigma (Schaub and Junkins, Analytical Mechanics of Space Systems, section
3.5):

    R = 1 + (4 (1 - s) [sigma] + 8 [sigma]^2)/(1 + s)^2
    omega = ((1 - s) 1 + 2 [sigma] + 2 sigma sigma') q' / (1 + s)^2     in the parent's axes

For small angles q is the rotation vector, and at q = 0 its rate is omega. The map is conformal:
changes of q in all directions turn the body equally far. It is regular up to a full turn, and q
and -16 q/(q' q) are the same rotation, so that each step ends with the shorter of the two.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import casadi as ca
import numpy as np

Axis = tuple[float, float, float]
"""A constant unit vector."""
X_AXIS, Y_AXIS, Z_AXIS = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SIZE = 3
"""Coordinates of a ball."""
HALF_TURN = 16.0
"""q' q of a turn by pi, at which both vectors of a rotation are as long."""


def unit(direction: Iterable[float]) -> Axis:
    """The unit vector of a direction."""
    x, y, z = np.array([*direction], float) / np.linalg.norm([*direction])
    return float(x) + 0.0, float(y) + 0.0, float(z) + 0.0  # without a negative zero


def normals(axis: Axis) -> tuple[Axis, Axis]:
    """Two unit vectors t, n with n = axis x t, perpendicular to an axis and to one another."""
    a = np.array(axis)
    e = np.eye(3)[np.abs(a).argmin()]
    t = unit(e - a * (a @ e))
    return t, unit(np.cross(a, t))


def cross(v: ca.SX) -> ca.SX:
    """[v], with [v] w = v x w."""
    return ca.skew(v)


def about(axis: Axis, angle: ca.SX) -> ca.SX:
    """R (3 x 3) of a turn about an axis."""
    along, across, beside = _parts(axis)
    return ca.sparsify(along + ca.cos(angle) * across + ca.sin(angle) * beside)


@cache
def _parts(axis: Axis) -> tuple[ca.SX, ca.SX, ca.SX]:
    """a a', 1 - a a' and [a] of an axis a."""
    a = ca.SX(ca.sparsify(ca.DM(axis)))
    along = ca.sparsify(a @ a.T)
    return along, ca.sparsify(ca.SX.eye(3) - along), ca.sparsify(cross(a))


def of_ball(q: ca.SX) -> ca.SX:
    """R (3 x 3) of a ball's coordinates."""
    sigma = q / 4
    s, K = ca.dot(sigma, sigma), cross(sigma)
    return ca.SX.eye(3) + (4 * (1 - s) * K + 8 * K @ K) / (1 + s) ** 2


def rates_of_ball(q: ca.SX) -> ca.SX:
    """omega (3 x 3) for unit rates of a ball's coordinates, in the parent's axes."""
    sigma = q / 4
    s = ca.dot(sigma, sigma)
    return ((1 - s) * ca.SX.eye(3) + 2 * cross(sigma) + 2 * sigma @ sigma.T) / (1 + s) ** 2


def shorten(q: ca.SX, qd: ca.SX, balls: Iterable[int]) -> tuple[ca.SX, ca.SX]:
    """Coordinates and rates (n x 1 each) with the shorter vector of each ball, whose coordinates
    begin at the given indices."""
    q, qd = ca.SX(q), ca.SX(qd)
    for i in balls:
        v, rate = q[i : i + SIZE], qd[i : i + SIZE]
        square = ca.dot(v, v)
        far = square > HALF_TURN
        ratio = HALF_TURN / ca.if_else(far, square, 1)
        turned = -ratio * (rate - 2 * v * (ca.dot(v, rate) / ca.if_else(far, square, 1)))
        q[i : i + SIZE] = ca.if_else(far, -ratio * v, v)
        qd[i : i + SIZE] = ca.if_else(far, turned, rate)
    return q, qd
