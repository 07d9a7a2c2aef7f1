"""Signals over time as a scene gives them to hands and drives: tables, splines and sines."""

from __future__ import annotations

from hapticlink.components.paths.sine import TimeSine
from hapticlink.components.paths.spline import TimeSpline
from hapticlink.components.paths.table import TimeTable
from hapticlink.components.specs.paths import AnySine, Interpolation
from hapticlink.components.time_signals import Rows, TimeSignal

__all__ = ["TimeSine", "TimeSpline", "TimeTable", "signal"]


def signal(given: Rows | AnySine, interpolation: Interpolation, name: str) -> TimeSignal:
    """The signal that a record gives by rows or by a sine. Raises ValueError, with `name`, for a
    spline without rows."""
    if isinstance(given, AnySine):
        if interpolation != "linear":
            raise ValueError(
                f"`{name}`: a sine has no rows: give rows, or leave `interpolation` out"
            )
        return TimeSine(given, name)
    return TimeSpline(given, name) if interpolation == "spline" else TimeTable(given, name)
