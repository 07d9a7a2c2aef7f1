"""[device]: the twin pantograph and its observer, as a scene writes them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from hapticlink.components.port_space import PLANE, PortSpace
from hapticlink.components.specs.driver import Driver
from hapticlink.components.specs.quantities import (
    Length,
    LinearDamping,
    LinearStiffness,
    Mass,
    MomentOfInertia,
    Position,
    Quantity,
)


@dataclass(frozen=True, kw_only=True)
class Observer:
    """Observer of the handle's velocity and of the hand's wrench (section 4.2.1)."""

    law: Literal["nicosia", "kalman"] = "nicosia"
    """nicosia: the report's; kalman: pose, velocity and wrench by the device's dynamics, with about
    half the tracking error at as much noise ([the device](device.md#the-kalman-observer))."""
    rule: Literal["forward", "backward", "trapezoidal"] = "backward"
    """Discretisation rule of section 1.3.1; of nicosia."""
    omega_n: Annotated[float, Quantity("rad/s", gt=0)] | None = None
    """Bandwidth; by default 50, of kalman that at which counts make an error of the force of 0.05 N
    (rms), by inertia, counts and haptic rate."""
    k_D: Annotated[float, Quantity("1/s", gt=0)] = 100.0
    """Output gain; of nicosia."""
    beside: bool = False
    """true: the observer is an FMU of its own beside the device. The device then takes torques
    and puts out base angles, as an observed device from elsewhere does; the numbers are the same.
    Needs sensing = "encoders"."""


@dataclass(frozen=True, kw_only=True)
class Device:
    """Twin pantograph. The report gives no dimensions: every number here is assumed, except for the
    0.09 degrees of an encoder count.

    Two five-bars in parallel planes, A and B, hold the ends of a crank at p -+ (crank/2)
    (cos theta, sin theta), p the handle. Base joints at (base_x -+ base_half_width, base_y_a) and
    (..., base_y_b), elbows outward: [the device](device.md).
    """

    proximal_length: Length = 0.16
    """Length of the links next to the motors."""
    distal_length: Length = 0.20
    """Length of the links between elbow and crank."""
    crank: Length = 0.08
    """Length of the crank between the two planes."""
    base_x: Position = -0.005
    """x midway between the base joints of a plane."""
    base_half_width: Annotated[float, Quantity("m", ge=0)] = 0.03
    """Half the distance between the base joints of a plane."""
    base_y_a: Position = -0.20
    """y of the base joints of plane A, below the workspace."""
    base_y_b: Position = 0.20
    """y of the base joints of plane B, above the workspace."""
    rotor_inertia: MomentOfInertia = 1.4e-5
    """Inertia of each motor's rotor."""
    proximal_mass: Mass = 0.05
    """Mass of each proximal link."""
    proximal_center: Position = 0.07
    """Its centre of mass from the base joint, along the link."""
    proximal_inertia: MomentOfInertia = 1.07e-4
    """Its inertia about the centre of mass."""
    distal_mass: Mass = 0.035
    """Mass of each distal link."""
    distal_center: Position = 0.10
    """Its centre of mass from the elbow, along the link."""
    distal_inertia: MomentOfInertia = 1.17e-4
    """Its inertia about the centre of mass."""
    handle_mass: Annotated[float, Quantity("kg", gt=0)] = 0.12
    """Mass of handle and crank."""
    handle_inertia: Annotated[float, Quantity("kg.m2", gt=0)] = 8e-5
    """Inertia of handle and crank."""
    motor_damping: Annotated[float, Quantity("N.m.s/rad", ge=0)] = 0.0
    """Viscous damping about the axis of each motor."""
    motor_friction: Annotated[float, Quantity("N.m", ge=0)] = 0.0
    """Dry friction about the axis of each motor: motor_friction tanh(rate/(0.1 rad/s))."""
    torque_limit: Annotated[float, Quantity("N.m", gt=0)] = 0.5
    """Largest torque of a motor; if one would exceed it, all four are scaled by one factor."""
    encoder_resolution: Annotated[float, Quantity("rad", gt=0)] = 0.0015707963267948966
    """Angle of one encoder count (0.09 degrees)."""
    reach_limit: Annotated[float, Quantity("1", gt=0.5, lt=1)] = 0.95
    """Fraction of an arm's full reach at which the stops begin."""
    stop_stiffness: LinearStiffness = 5000.0
    """Stiffness of the stops."""
    stop_damping: LinearDamping = 20.0
    """Damping of the stops."""
    substeps: Annotated[int, Quantity("1", ge=1, le=100)] = 1
    """Integration steps per communication step; the size of the FMU's equations grows with them."""
    observer: Observer = field(default_factory=Observer)
    """The observer, used with sensing = "encoders"."""
    driver: Driver | None = None
    """The board that takes the device's place in a run in real time, once it has a port."""

    @property
    def space(self) -> PortSpace:
        """That of the port at the handle."""
        return PLANE
