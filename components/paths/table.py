"""Tables of time: rows (time, values...), linear between rows, constant outside.

At an instant a table has y(t) and the rate of the segment that begins there. An integration method
that steps over [t, t + h] uses the quadratic through y(t), y(t + h/2) and y(t + h) instead, with
s = (time - t)/h:

    y = y_0 + s (3 d_1 - d_2) + 2 s^2 (d_2 - d_1),   d_1 = y_{1/2} - y_0,  d_2 = y_1 - y_{1/2}

It equals the table where rows coincide with the ends of steps, so that a method keeps its order. A
row within a step reduces the order to 2: the integral of the rate over the step is exact, but not
its jump.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.time_signals import LookUp, Rows, TimeSignal, checked


class TimeTable(TimeSignal):
    """A table of k values over time. Raises ValueError, with `name`, for an empty table, for
    numbers that are not finite and for times that do not increase."""

    def __init__(self, rows: Rows, name: str) -> None:
        data = checked(rows, name)
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
