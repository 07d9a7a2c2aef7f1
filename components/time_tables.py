"""Signals given as tables of time: rows (time, values...), linear between rows, constant outside.

The rows are data, not terms of a graph: a graph calls a look-up, whose cost is logarithmic in the
number of rows. At an instant it returns y(t) and the rate of the segment that begins there. An
integration method that steps over [t, t + h] uses the quadratic through y(t), y(t + h/2) and
y(t + h) instead, with s = (time - t)/h:

    y = y_0 + s (3 d_1 - d_2) + 2 s^2 (d_2 - d_1),   d_1 = y_{1/2} - y_0,  d_2 = y_1 - y_{1/2}

It equals the table where rows coincide with the ends of steps, so that a method keeps its order. A
row within a step reduces the order to 2: the integral of the rate over the step is exact, but not
its jump.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Rows = Sequence[tuple[float, ...]]


class TimeTable:
    """A table of k values over time. Raises ValueError, with `name`, for an empty table, for
    numbers that are not finite and for times that do not increase."""

    def __init__(self, rows: Rows, name: str) -> None:
        data = _checked(rows, name)
        self.rows, self.size = rows, data.shape[1] - 1
        self.called = f"table_{hashlib.sha256(data.tobytes()).hexdigest()[:16]}"
        if len(rows) > 1:
            times, values = data[:, 0].tolist(), data[:, 1:].ravel().tolist()
            how = {"lookup_mode": ["binary"]}
            self._value = ca.interpolant(self.called, "linear", [times], values, how)
            self._rate = self._value.jacobian()

    def value(self, t: ca.SX) -> ca.SX:
        """y(t), k x 1."""
        if len(self.rows) == 1:
            return ca.SX(ca.DM(self.rows[0][1:]))
        return self._value(ca.fmin(ca.fmax(t, self.rows[0][0]), self.rows[-1][0]))

    def at(self, t: ca.SX) -> ca.SX:
        """(y, y') at t, 2k x 1; at the time of a row y' is that of the segment beginning there."""
        rate = ca.SX(self.size, 1)
        if len(self.rows) > 1:
            inside = ca.logic_and(t >= self.rows[0][0], t < self.rows[-1][0])
            rate = ca.if_else(inside, self._rate(t, ca.SX(self.size, 1)), 0)
        return ca.vertcat(self.value(t), rate)

    def over(self, t: ca.SX, h: ca.SX) -> ca.SX:
        """Coefficients of the quadratic in (time - t) over [t, t + h], 3k x 1."""
        start, middle, end = (self.value(t + c * h) for c in (0, 0.5, 1))
        first, second = middle - start, end - middle
        return ca.vertcat(start, (3 * first - second) / h, 2 * (second - first) / h**2)


def _checked(rows: Rows, name: str) -> NDArray[np.float64]:
    if not rows:
        raise ValueError(f"`{name}`: the table has no rows; give at least one")
    data = np.array(rows, dtype="<f8")
    for i in np.flatnonzero(~np.isfinite(data).all(axis=1)).tolist():
        raise ValueError(f"`{name}`: row {i + 1} is {rows[i]}; give finite numbers")
    for i in np.flatnonzero(np.diff(data[:, 0]) <= 0).tolist():
        raise ValueError(
            f"`{name}`: row {i + 2} at t = {rows[i + 1][0]} s does not come after {rows[i][0]} s; "
            "sort the rows by time"
        )
    return data


def at(tables: Iterable[TimeTable], t: ca.SX) -> ca.SX:
    """(y, y') of each table at t, stacked."""
    return ca.vertcat(*(table.at(t) for table in tables))


def over(tables: Iterable[TimeTable], t: ca.SX, h: ca.SX) -> ca.SX:
    """t and the quadratics of each table over [t, t + h], stacked, for `within`."""
    return ca.vertcat(t, *(table.over(t, h) for table in tables))


def within(tables: Iterable[TimeTable], over: ca.SX, t: ca.SX) -> ca.SX:
    """(y, y') of each table at t, stacked, from the quadratics `over` of the step that contains
    t."""
    s, found, place = t - over[0], [], 1
    for table in tables:
        k = table.size
        start, first, second = (over[place + i * k : place + (i + 1) * k] for i in range(3))
        found += [start + s * (first + s * second), first + 2 * s * second]
        place += 3 * k
    return ca.vertcat(*found)


def size_over(tables: Iterable[TimeTable]) -> int:
    """The number of entries of `over`."""
    return 1 + sum(3 * table.size for table in tables)
