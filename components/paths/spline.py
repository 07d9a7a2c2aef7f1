"""Splines of time: the cubic spline through rows (time, values...), constant outside.

Its rate is 0 in the first and in the last row (a clamped spline), so that y and y' are continuous
at all times, and y'' at all times but those two. An integration method evaluates both at each of
its stages. Where rows coincide with the ends of steps it keeps its order; a row within a step
reduces the order to 3, since there y''' jumps.

On segment j, y = c_0 + s (c_1 + s (c_2 + s c_3)) with s = t - t_j. One look-up finds j, another one
the numbers of segment j, whose grid is j itself.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from hapticlink.components.time_signals import LookUp, Rows, TimeSignal, checked


class TimeSpline(TimeSignal):
    """The clamped cubic spline through rows of k values. Raises ValueError, with `name`, where
    TimeTable does, and where the rows are so close that the spline is not finite."""

    def __init__(self, rows: Rows, name: str) -> None:
        data = checked(rows, name)
        self.rows, self.size = rows, data.shape[1] - 1
        if len(rows) < 2:
            return
        from scipy.interpolate import CubicSpline  # slow to load

        times, number = data[:, 0], np.arange(len(rows), dtype=float)
        with np.errstate(all="ignore"):
            cubics = CubicSpline(times, data[:, 1:], bc_type="clamped").c[::-1]
        if not np.isfinite(cubics).all():
            raise ValueError(f"`{name}`: no spline through rows so close: leave some of them out")
        constant = np.zeros((4, 1, self.size))  # from the last row on
        constant[0] = data[-1, 1:]
        cubics = np.concatenate([cubics, constant], axis=1).transpose(1, 0, 2)
        pieces = np.column_stack([times, cubics.reshape(len(rows), -1)])
        self.look_ups = (LookUp(times, number[:, None]), LookUp(number, pieces))

    def at(self, t: ca.SX) -> ca.SX:
        if not self.look_ups:
            return ca.vertcat(ca.DM(self.rows[0][1:]), ca.SX(self.size, 1))
        segments, pieces = self.look_ups
        t = ca.fmin(ca.fmax(t, self.rows[0][0]), self.rows[-1][0])
        piece = pieces.value(ca.floor(segments.value(t)))
        s, (c0, c1, c2, c3) = t - piece[0], ca.vertsplit(piece[1:], self.size)
        return ca.vertcat(c0 + s * (c1 + s * (c2 + s * c3)), c1 + s * (2 * c2 + 3 * s * c3))
