"""[controller]: impedance, teleoperation and topology gains, as a scene writes them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from hapticlink.components.specs.quantities import Damping, Quantity, Stiffness


@dataclass(frozen=True, kw_only=True)
class Topology:
    """Topology (joint-constraint) controller: a stiffness along the constrained directions."""

    stiffness: Annotated[float, Quantity("N/(m.kg)", ge=0)] = 200.0
    """k_j, per kilogram of the device's inertia along the constrained directions."""
    damping: Annotated[float, Quantity("N.s/(m.kg)", ge=0)] = 50.0
    """b_j, per kilogram of the same inertia."""
    form: Literal["constrained", "plain"] = "constrained"
    """constrained: F_T of [theory](theory.md); plain: M_d P_c (k_j e + b_j edot), for comparison
    only, as it does work on free motion and depends on the length scale."""


@dataclass(frozen=True, kw_only=True)
class Teleoperation:
    """Position channels of the four-channel controller: F_drift = K_pc (x_S - x_D) + B_pc (v_S -
    v_D) of section B.6."""

    stiffness: Stiffness = (100.0, 100.0, 0.5)
    """K_pc."""
    damping: Damping = (70.0, 70.0, 0.375)
    """B_pc."""


@dataclass(frozen=True, kw_only=True)
class Controller:
    """The controller of the device. A part that is false or left out adds no term, no input and no
    parameter."""

    impedance: bool = True
    """Impedance control: the device moves as the mechanism would move."""
    bias: Literal["none", "full"] = "none"
    """full: adds M_d a_bias, the compensation of the mechanism's Coriolis and centrifugal terms,
    gravity, springs and drives; none: leaves it out (the report)."""
    damping: Damping | None = None
    """B_d, the desired damping of (4.1)."""
    stiffness: Stiffness | None = None
    """K_d, the desired stiffness of (4.1), about the starting pose."""
    teleoperation: Teleoperation | Literal[False] = field(default_factory=Teleoperation)
    """Position channels between the operational point and the handle."""
    topology: Topology | bool = True
    """Topology controller; true for its defaults."""
    contact: bool = False
    """Whether contacts are felt: F_env enters the impedance law. Needs [contacts]. With further
    hands or efforts on joints it always does, with all that acts beside the hand."""
