"""What blocks and integration steps read of a signal that is given over time.

The rows of a table or spline are data, not terms of a graph: a graph calls a look-up, whose cost is
logarithmic in the number of rows.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Rows = Sequence[tuple[float, ...]]


class LookUp:
    """Linear interpolation of `values` (n x k, n >= 2) on an increasing grid of n points, which
    `called` names."""

    def __init__(self, grid: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        self.grid, self.values = grid, values
        data = np.column_stack([grid, values]).astype("<f8").tobytes()
        self.called = f"table_{hashlib.sha256(data).hexdigest()[:16]}"
        points, ordered = grid.tolist(), values.ravel().tolist()
        self._value = ca.interpolant(
            self.called, "linear", [points], ordered, {"lookup_mode": ["binary"]}
        )
        self._slope = self._value.jacobian()

    def value(self, at: ca.SX) -> ca.SX:
        """The interpolated values, k x 1; `at` is to lie on the grid."""
        return self._value(at)

    def slope(self, at: ca.SX) -> ca.SX:
        """Their slope, k x 1: at a point of the grid that of the segment which begins there."""
        return self._slope(at, ca.SX(self.values.shape[1], 1))


class TimeSignal(ABC):
    """A signal of k values over time. look_ups: those that its expressions call."""

    size: int
    look_ups: tuple[LookUp, ...] = ()
    size_over: int = 0
    """Number of entries of `over`."""

    @abstractmethod
    def at(self, t: ca.SX) -> ca.SX:
        """(y, y') at the instant t, 2k x 1."""

    def value(self, t: ca.SX) -> ca.SX:
        """y(t), k x 1."""
        return self.at(t)[: self.size]

    def over(self, t: ca.SX, h: ca.SX) -> ca.SX:
        """What `within` needs to know of the step [t, t + h]; nothing where y and y' are
        continuous."""
        return ca.SX(0, 1)

    def within(self, over: ca.SX, start: ca.SX, t: ca.SX) -> ca.SX:
        """(y, y') at t, 2k x 1, in the step that begins at `start`, of which `over` is known."""
        return self.at(t)


def check_rows(rows: Rows, name: str) -> NDArray[np.float64]:
    """The rows as an array. Raises ValueError, with `name`, where there are none, for rows of a
    time alone, for numbers that are not finite and for times that do not increase."""
    if not rows:
        raise ValueError(f"`{name}`: the table has no rows; give at least one")
    if len(rows[0]) < 2:
        raise ValueError(f"`{name}`: a row has at least one value beside its time (s)")
    for i, row in enumerate(rows):
        if len(row) != len(rows[0]):
            raise ValueError(
                f"`{name}`: row {i + 1} has {len(row)} numbers, the first one {len(rows[0])}"
            )
    data = np.array(rows, dtype="<f8")
    for i in np.flatnonzero(~np.isfinite(data).all(axis=1)).tolist():
        raise ValueError(f"`{name}`: row {i + 1} is {rows[i]}; give finite numbers")
    for i in np.flatnonzero(np.diff(data[:, 0]) <= 0).tolist():
        raise ValueError(
            f"`{name}`: row {i + 2} at t = {rows[i + 1][0]} s does not come after {rows[i][0]} s; "
            "sort the rows by time"
        )
    return data


def at(signals: Iterable[TimeSignal], t: ca.SX) -> ca.SX:
    """(y, y') of each signal at t, stacked."""
    return ca.vertcat(*(signal.at(t) for signal in signals))


def over(signals: Iterable[TimeSignal], t: ca.SX, h: ca.SX) -> ca.SX:
    """t and what is known of each signal over [t, t + h], stacked, for `within`."""
    return ca.vertcat(t, *(signal.over(t, h) for signal in signals))


def within(signals: Iterable[TimeSignal], over: ca.SX, t: ca.SX) -> ca.SX:
    """(y, y') of each signal at t, stacked, from `over` of the step that contains t."""
    values, place = [], 1
    for signal in signals:
        end = place + signal.size_over
        values.append(signal.within(over[place:end], over[0], t))
        place = end
    return ca.vertcat(*values)


def size_over(signals: Iterable[TimeSignal]) -> int:
    """The number of entries of `over`."""
    return 1 + sum(signal.size_over for signal in signals)
