"""Signals of time from a table."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import casadi as ca


def interpolate(table: Sequence[tuple[float, ...]], t: ca.SX, name: str) -> ca.SX:
    """Value at t of rows (time, values...): linear between rows, the ends held.

    y_0 + sum over i of (y_i+1 - y_i) clip((t - t_i)/(t_i+1 - t_i), 0, 1).
    Raises ValueError, with `name`, for an empty table and for times that do not increase.
    """
    if not table:
        raise ValueError(f"`{name}`: the table has no rows; give at least one")
    value = ca.SX(ca.DM(table[0][1:]))
    for i, ((t0, *y0), (t1, *y1)) in enumerate(pairwise(table), start=2):
        if not t1 > t0:
            raise ValueError(
                f"`{name}`: row {i} at t = {t1} s does not come after {t0} s; sort the rows by time"
            )
        value += (ca.DM(y1) - ca.DM(y0)) * ca.fmin(1, ca.fmax(0, (t - t0) / (t1 - t0)))
    return value


def slope(table: Sequence[tuple[float, ...]], t: ca.SX) -> ca.SX:
    """Rate of `interpolate` at t; at a row's time that of the segment which begins there."""
    rate = ca.SX(len(table[0]) - 1, 1)
    for (t0, *y0), (t1, *y1) in pairwise(table):
        inside = ca.logic_and(t >= t0, t < t1)
        rate += ca.if_else(inside, (ca.DM(y1) - ca.DM(y0)) / (t1 - t0), 0)
    return rate
