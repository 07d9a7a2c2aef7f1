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


@dataclass(frozen=True, kw_only=True)
class Teleoperation:
    """Position channels of the four-channel controller: F_drift = K_pc (x_S - x_D) + B_pc (v_S -
    v_D) of section B.6."""

    stiffness: Stiffness = (100.0, 100.0, 0.5)
    """K_pc."""
    damping: Damping = (70.0, 70.0, 0.375)
    """B_pc."""


@dataclass(frozen=True, kw_only=True)
class PassivityLaw:
    """Time-domain passivity observer and controller (Hannaford and Ryu 2002): what the motors give
    beyond a budget is taken out by damping ([energy](energy.md#passivity-controller))."""

    energy: Annotated[float, Quantity("J", ge=0)] = 0.0
    """What the motors may give in all: the energy of drives and gravity, of a mechanism in motion
    at the start, and (m_D - m_S) v^2/2 where the handle shall feel lighter than the device."""
    limit: Annotated[float, Quantity("1", gt=0, lt=2)] = 0.5
    """Largest damping times the period, by the device's inertia; a sampled damper is stable below
    2."""
    noise: Annotated[float, Quantity("J", gt=0)] = 1e-9
    """Kinetic energy of the handle below which nothing is damped: with encoders, that of one count
    in a period."""
    reset_after: Annotated[float, Quantity("s", gt=0)] | None = None
    """Time without a wrench after which the energy that was absorbed is forgotten; by default it
    never is."""


@dataclass(frozen=True, kw_only=True)
class Controller:
    """The controller of the device. A part that is false or left out adds no term, no input and no
    parameter."""

    impedance: bool = True
    """Impedance control: the device moves as the mechanism would move."""
    bias: Literal["none", "full"] | None = None
    """full: adds M_d a_bias, the compensation of the mechanism's Coriolis and centrifugal terms,
    gravity, springs and drives; none: leaves it out (the report). By default full with a device
    whose bodies weigh less than 0.2 kg in all, which makes up for little of what is left out; none
    with another."""
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
    hands or efforts on joints F_env always enters, with all that acts beside the hand."""
    passivity: PassivityLaw | bool = False
    """Passivity controller at the motors; true for its defaults."""
