"""[hand]: the user, as a scene writes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from hapticlink.components.specs.paths import Interpolation, PoseSine, WrenchSine
from hapticlink.components.specs.quantities import (
    Angle,
    Damping,
    Force,
    Inertia,
    LinearDamping,
    LinearStiffness,
    Position,
    Quantity,
    Stiffness,
    Time,
    Torque,
    Wrench,
)

Path = tuple[tuple[Time, Position, Position, Angle], ...]


@dataclass(frozen=True, kw_only=True)
class ConstantHand:
    """A constant wrench on the handle, with an optional damping to ground."""

    type: Literal["constant"] = "constant"
    """A constant wrench."""
    wrench: Wrench
    """Force and moment on the handle."""
    damping: Damping | None = None
    """Damping of the handle to ground."""


@dataclass(frozen=True, kw_only=True)
class ProfileHand:
    """A wrench on the handle over time, with an optional damping to ground."""

    type: Literal["profile"] = "profile"
    """A wrench over time."""
    table: tuple[tuple[Time, Force, Force, Torque], ...] | WrenchSine
    """Rows of time, force and moment, sorted by time, the ends held; a sine; or a recorded log,
    `{ path, columns, units }`: [recorded hands](scenes.md#recorded-hands)."""
    interpolation: Interpolation = "linear"
    """Between rows: linear, the cubic spline whose rate is 0 at both ends, or each row held until
    the next."""
    damping: Damping | None = None
    """Damping of the handle to ground."""


@dataclass(frozen=True, kw_only=True)
class ArmHand:
    """An arm behind a grip: a mass with springs and dampers to a target path and to the handle."""

    type: Literal["arm"] = "arm"
    """An arm behind a grip."""
    mass: Inertia = (1.0, 1.0, 0.002)
    """M_a, mass and moment of inertia of the arm."""
    stiffness: Stiffness = (300.0, 300.0, 1.0)
    """K_a, arm to target."""
    damping: Damping = (10.0, 10.0, 0.02)
    """B_a, arm to target."""
    grip_stiffness: Stiffness = (2000.0, 2000.0, 5.0)
    """K_gr, arm to handle."""
    grip_damping: Damping = (20.0, 20.0, 0.05)
    """B_gr, arm to handle."""
    target: Path | PoseSine
    """Rows of time and pose, sorted by time, the ends held; a sine; or a recorded log."""
    interpolation: Interpolation = "linear"
    """Between rows: linear, the cubic spline whose rate is 0 at both ends, or each row held until
    the next."""
    timing: Literal["sampled", "continuous"] = "sampled"
    """sampled: F is that at the beginning of a communication step; continuous: a plant, whose F is
    that at the end of its step."""


@dataclass(frozen=True, kw_only=True)
class SpringHand:
    """A massless hand: a spring and damper from the handle to a target path."""

    type: Literal["spring"] = "spring"
    """A spring and damper."""
    stiffness: Stiffness
    """Stiffness, handle to target."""
    damping: Damping | None = None
    """Damping, handle to target; by default none."""
    target: Path | PoseSine = ((0.0, 0.0, 0.0, 0.0),)
    """Rows of time and pose, sorted by time, the ends held; a sine; or a recorded log."""
    interpolation: Interpolation = "linear"
    """Between rows: linear, the cubic spline whose rate is 0 at both ends, or each row held until
    the next."""
    timing: Literal["sampled", "continuous"] = "sampled"
    """sampled: F is that at the beginning of a communication step; continuous: a plant, whose F is
    that at the end of its step."""


@dataclass(frozen=True, kw_only=True)
class FingertipHand:
    """A fingertip that touches the handle in a point: a finger's mass behind its pulp, which passes
    on forces and no moment. All defaults are assumed."""

    type: Literal["fingertip"] = "fingertip"
    """A fingertip with point contact."""
    mass: Annotated[float, Quantity("kg", gt=0)] = 0.006
    """Mass of the finger that moves along."""
    stiffness: LinearStiffness = 400.0
    """Stiffness, finger to target."""
    damping: LinearDamping = 3.0
    """Damping, finger to target."""
    pulp_stiffness: LinearStiffness = 1500.0
    """Stiffness of the pulp, finger to handle."""
    pulp_damping: LinearDamping = 1.5
    """Damping of the pulp, finger to handle."""
    target: Path | PoseSine = ((0.0, 0.0, 0.0, 0.0),)
    """Rows of time and pose, sorted by time, the ends held; a sine; or a recorded log. The angle is
    left out."""
    interpolation: Interpolation = "linear"
    """Between rows: linear, the cubic spline whose rate is 0 at both ends, or each row held until
    the next."""
    timing: Literal["sampled", "continuous"] = "sampled"
    """sampled: F is that at the beginning of a communication step; continuous: a plant, whose F is
    that at the end of its step."""


HoldingHand = ArmHand | SpringHand | FingertipHand
"""Hands with a stiffness, which a target moves."""
Hand = ConstantHand | ProfileHand | HoldingHand
