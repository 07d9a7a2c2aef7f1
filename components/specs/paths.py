"""Sines in the place of a table of time, as a scene writes them: for each coordinate
mean + amplitude sin(2 pi frequency t + phase)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from hapticlink.components.specs.quantities import (
    Angle,
    Coordinate,
    Effort,
    Pose,
    Quantity,
    Wrench,
)

Interpolation = Literal["linear", "spline", "hold"]
Frequency = Annotated[float, Quantity("Hz", ge=0)]
Frequencies = tuple[Frequency, Frequency, Frequency]
Angles = tuple[Angle, Angle, Angle]


@dataclass(frozen=True, kw_only=True)
class PoseSine:
    """A sine of each coordinate of a pose."""

    mean: Pose = (0.0, 0.0, 0.0)
    """Mean pose."""
    amplitude: Pose
    """Amplitude of each coordinate."""
    frequency: Frequencies
    """Frequency of each coordinate."""
    phase: Angles = (0.0, 0.0, 0.0)
    """Phase of each coordinate at t = 0."""


@dataclass(frozen=True, kw_only=True)
class WrenchSine:
    """A sine of each component of a wrench."""

    mean: Wrench = (0.0, 0.0, 0.0)
    """Mean wrench."""
    amplitude: Wrench
    """Amplitude of each component."""
    frequency: Frequencies
    """Frequency of each component."""
    phase: Angles = (0.0, 0.0, 0.0)
    """Phase of each component at t = 0."""


@dataclass(frozen=True, kw_only=True)
class CoordinateSine:
    """A sine of a joint's coordinate."""

    mean: Coordinate = 0.0
    """Mean."""
    amplitude: Coordinate
    """Amplitude."""
    frequency: Frequency
    """Frequency."""
    phase: Angle = 0.0
    """Phase at t = 0."""


@dataclass(frozen=True, kw_only=True)
class EffortSine:
    """A sine of a joint's effort."""

    mean: Effort = 0.0
    """Mean."""
    amplitude: Effort
    """Amplitude."""
    frequency: Frequency
    """Frequency."""
    phase: Angle = 0.0
    """Phase at t = 0."""


AnySine = PoseSine | WrenchSine | CoordinateSine | EffortSine
