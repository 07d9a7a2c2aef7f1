"""Signals over time as a scene gives them to hands and drives: rows joined by lines or by a cubic
spline, or held, and sines."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from hapticlink.components.specs.paths import AnySine, Interpolation
from hapticlink.components.time_signals import LookUp, Rows, TimeSignal, check_rows


class TimeTable(TimeSignal):
    """Rows (time, k values), linear between rows, constant outside.

    At an instant a table has y(t) and the rate of the segment that begins there. An integration
    method that steps over [t, t + h] uses the quadratic through y(t), y(t + h/2) and y(t + h)
    instead, with s = (time - t)/h:

        y = y_0 + s (3 d_1 - d_2) + 2 s^2 (d_2 - d_1),   d_1 = y_{1/2} - y_0,  d_2 = y_1 - y_{1/2}

    It equals the table where rows coincide with the ends of steps, so that a method keeps its
    order. A row within a step reduces the order to 2: the integral of the rate over the step is
    exact, but not its jump. Raises ValueError, with `name`, for an empty table, for numbers that
    are not finite and for times that do not increase.
    """

    def __init__(self, rows: Rows, name: str) -> None:
        data = check_rows(rows, name)
        self.rows, self.size = rows, data.shape[1] - 1
        self.size_over = 3 * self.size
        if len(rows) > 1:
            self.look_ups = (LookUp(data[:, 0], data[:, 1:]),)

    def value(self, t: ca.SX) -> ca.SX:
        if not self.look_ups:
            return ca.SX(ca.DM(self.rows[0][1:]))
        return self.look_ups[0].value(ca.fmin(ca.fmax(t, self.rows[0][0]), self.rows[-1][0]))

    def at(self, t: ca.SX) -> ca.SX:
        """(y, y') at t, 2k x 1; at the time of a row y' is that of the segment beginning there."""
        rate = ca.SX(self.size, 1)
        if self.look_ups:
            inside = ca.logic_and(t >= self.rows[0][0], t < self.rows[-1][0])
            rate = ca.if_else(inside, self.look_ups[0].slope(t), 0)
        return ca.vertcat(self.value(t), rate)

    def over(self, t: ca.SX, h: ca.SX) -> ca.SX:
        """Coefficients of the quadratic in (time - t) over [t, t + h], 3k x 1."""
        start, middle, end = (self.value(t + c * h) for c in (0, 0.5, 1))
        first, second = middle - start, end - middle
        return ca.vertcat(start, (3 * first - second) / h, 2 * (second - first) / h**2)

    def within(self, over: ca.SX, start: ca.SX, t: ca.SX) -> ca.SX:
        s, (value, first, second) = t - start, ca.vertsplit(over, self.size)
        return ca.vertcat(value + s * (first + s * second), first + 2 * s * second)


class TimeSpline(TimeSignal):
    """The clamped cubic spline through rows (time, k values), constant outside.

    Its rate is 0 in the first and in the last row, so that y and y' are continuous at all times,
    and y'' at all times but those two. An integration method evaluates both at each of its stages.
    Where rows coincide with the ends of steps it keeps its order; a row within a step reduces the
    order to 3, since there y''' jumps.

    On segment j, y = c_0 + s (c_1 + s (c_2 + s c_3)) with s = t - t_j. One look-up finds j, another
    one the numbers of segment j, whose grid is j itself. Raises ValueError, with `name`, where
    TimeTable does, and where the rows are so close that the spline is not finite.
    """

    def __init__(self, rows: Rows, name: str) -> None:
        data = check_rows(rows, name)
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


class TimeSteps(TimeSignal):
    """Rows (time, k values), of which each is held until the next; the first one before it, too.

    An integration method takes the value at the beginning of its step for all of it, so that a row
    within a step acts from the next one on. One look-up finds the row, another one its numbers.
    Raises ValueError, with `name`, where TimeTable does.
    """

    def __init__(self, rows: Rows, name: str) -> None:
        data = check_rows(rows, name)
        self.rows, self.size = rows, data.shape[1] - 1
        self.size_over = self.size
        if len(rows) > 1:
            number = np.arange(len(rows), dtype=float)
            self.look_ups = (LookUp(data[:, 0], number[:, None]), LookUp(number, data[:, 1:]))

    def at(self, t: ca.SX) -> ca.SX:
        if not self.look_ups:
            return ca.vertcat(ca.DM(self.rows[0][1:]), ca.SX.zeros(self.size, 1))
        row, values = self.look_ups
        t = ca.fmin(ca.fmax(t, self.rows[0][0]), self.rows[-1][0])
        return ca.vertcat(values.value(ca.floor(row.value(t))), ca.SX.zeros(self.size, 1))

    def over(self, t: ca.SX, h: ca.SX) -> ca.SX:
        return self.value(t)

    def within(self, over: ca.SX, start: ca.SX, t: ca.SX) -> ca.SX:
        return ca.vertcat(over, ca.SX.zeros(self.size, 1))


class TimeSine(TimeSignal):
    """y = mean + amplitude sin(2 pi frequency t + phase), each of k values with its own numbers.
    Raises ValueError, with `name`, for numbers that are not finite."""

    def __init__(self, sine: AnySine, name: str) -> None:
        given = (sine.mean, sine.amplitude, sine.frequency, sine.phase)
        columns = np.array(given, float).reshape(4, -1)
        if not np.isfinite(columns).all():
            raise ValueError(f"`{name}`: the sine is {given}; give finite numbers")
        self.mean, self.amplitude, frequency, self.phase = map(ca.DM, columns)
        self.omega = 2 * math.pi * frequency
        self.size = columns.shape[1]

    def at(self, t: ca.SX) -> ca.SX:
        angle = self.omega * t + self.phase
        value = self.mean + self.amplitude * ca.sin(angle)
        return ca.vertcat(value, self.amplitude * self.omega * ca.cos(angle))


def signal(given: Rows | AnySine, interpolation: Interpolation, name: str) -> TimeSignal:
    """The signal that a record gives by rows or by a sine. Raises ValueError, with `name`, for a
    spline without rows."""
    if isinstance(given, AnySine):
        if interpolation != "linear":
            raise ValueError(
                f"`{name}`: a sine has no rows: give rows, or leave `interpolation` out"
            )
        return TimeSine(given, name)
    if interpolation == "hold":
        return TimeSteps(given, name)
    return TimeSpline(given, name) if interpolation == "spline" else TimeTable(given, name)
