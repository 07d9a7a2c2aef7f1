"""[linkage.joint.drive]: the motors of joints, as a scene writes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hapticlink.components.specs.paths import CoordinateSine, EffortSine, Interpolation
from hapticlink.components.specs.quantities import (
    Coordinate,
    Effort,
    JointDamping,
    JointStiffness,
    Time,
)


@dataclass(frozen=True, kw_only=True)
class ConstantDrive:
    """A constant effort on a joint."""

    type: Literal["constant"] = "constant"
    """A constant effort."""
    effort: Effort
    """Torque of a revolute joint, force of a prismatic one."""


@dataclass(frozen=True, kw_only=True)
class ProfileDrive:
    """An effort over time."""

    type: Literal["profile"] = "profile"
    """An effort over time."""
    table: tuple[tuple[Time, Effort], ...] | EffortSine
    """Rows of time and effort, sorted by time, the ends held; a sine; or a recorded log."""
    interpolation: Interpolation = "linear"
    """Between rows: linear, the cubic spline whose rate is 0 at both ends, or each row held until
    the next."""


@dataclass(frozen=True, kw_only=True)
class PDDrive:
    """A servo: stiffness (target - q) + damping (target' - q')."""

    type: Literal["pd"] = "pd"
    """A servo that follows a target."""
    table: tuple[tuple[Time, Coordinate], ...] | CoordinateSine
    """Rows of time and target, sorted by time, the ends held; a sine; or a recorded log."""
    interpolation: Interpolation = "linear"
    """Between rows: linear, the cubic spline whose rate is 0 at both ends, or each row held until
    the next."""
    stiffness: JointStiffness
    """Gain on the position error."""
    damping: JointDamping
    """Gain on the velocity error."""


Drive = ConstantDrive | ProfileDrive | PDDrive
