"""[device]: a linkage with motors and encoders, and its observer, as a scene or a device file
writes them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import zip_longest
from typing import Annotated, Literal, cast

from hapticlink.components.port_space import PortSpace
from hapticlink.components.specs.bodies import Body, Inertias, Moments
from hapticlink.components.specs.driver import Driver
from hapticlink.components.specs.joint_types import JOINT_TYPES, JointType
from hapticlink.components.specs.linkage import Joint, Linkage, Loop, OperationalPoint
from hapticlink.components.specs.quantities import (
    Angle,
    Coordinate,
    Direction,
    Length,
    LinearDamping,
    LinearStiffness,
    Mass,
    MomentOfInertia,
    Place,
    Quantity,
)

LIGHT = 0.2
"""Mass (kg) below which a device is light."""


@dataclass(frozen=True, kw_only=True)
class Observer:
    """Observer of the handle's velocity and of the hand's wrench (section 4.2.1)."""

    law: Literal["nicosia", "kalman"] = "nicosia"
    """nicosia: the report's; kalman: pose, velocity and wrench by the device's dynamics, with about
    half the tracking error at as much noise ([the device](device.md#the-kalman-observer))."""
    rule: Literal["forward", "backward", "trapezoidal"] = "backward"
    """Discretisation rule of section 1.3.1; of nicosia."""
    omega_n: Annotated[float, Quantity("rad/s", gt=0)] | None = None
    """Bandwidth; by default that at which counts make a certain error of the force, by inertia and
    counts: of nicosia 0.11 N by a count, at most 300; of kalman 0.05 N (rms), by haptic rate,
    too."""
    k_D: Annotated[float, Quantity("1/s", gt=0)] | None = None
    """Output gain; of nicosia, by default twice the bandwidth."""
    beside: bool = False
    """true: the observer is an FMU of its own beside the device. The device then takes torques
    and puts out base angles, as an observed device from elsewhere does; the numbers are the same.
    Needs sensing = "encoders"."""


@dataclass(frozen=True, kw_only=True)
class DeviceBody:
    """A rigid body of a device."""

    name: str
    """Its name in joints and loops; not "ground"."""
    mass: Mass
    """Mass."""
    inertia: MomentOfInertia | Moments | Inertias
    """Moment of inertia about the centre of mass; in space as that of a body of a linkage."""
    center: Place | None = None
    """Centre of mass in the body's frame; by default its origin."""


@dataclass(frozen=True, kw_only=True)
class Motor:
    """A motor on a joint. What a joint does not say is that of [device.motor]."""

    torque_limit: Annotated[float, Quantity("N.m", gt=0)] | None = None
    """Largest torque; if one motor would exceed its own, all are scaled by one factor."""
    ratio: Annotated[float, Quantity("1 or rad/m")] | None = None
    """Turn of the rotor by that of the joint, or by its displacement; by default 1."""
    inertia: MomentOfInertia | None = None
    """Inertia of the rotor; by default 0."""
    damping: Annotated[float, Quantity("N.m.s/rad", ge=0)] | None = None
    """Viscous damping about its axis; by default 0."""
    friction: Annotated[float, Quantity("N.m", ge=0)] | None = None
    """Dry friction about its axis: friction tanh(rate/(0.1 rad/s)); by default 0."""


@dataclass(frozen=True, kw_only=True)
class Encoder:
    """An encoder on a joint."""

    resolution: Annotated[float, Quantity("rad or m", gt=0)] | None = None
    """Change of the joint's coordinate by a count."""


@dataclass(frozen=True, kw_only=True)
class DeviceJoint:
    """A joint of a device's tree."""

    name: str
    """Its name in `start`."""
    type: Literal["revolute", "prismatic"] = "revolute"
    """revolute: one angle; prismatic: one displacement along `axis`."""
    parent: str = "ground"
    """The body that carries the joint."""
    child: str
    """The body that the joint carries."""
    at_parent: Place | None = None
    """Position of the joint in the parent's frame; by default its origin."""
    at_child: Place | None = None
    """Position of the joint in the child's frame; by default its origin."""
    axis: Angle | Direction | None = None
    """Direction of a prismatic joint in the parent's frame, from its x axis; required there. In
    space the axis of any joint, three numbers in the parent's frame; by default its z axis."""
    motor: Motor | bool = False
    """Its motor; true for that of [device.motor]."""
    encoder: Encoder | bool = False
    """Its encoder; true for that of [device.encoder]."""
    range: tuple[Coordinate, Coordinate] | None = None
    """Where its stops begin; by default it has none."""

    @property
    def kind(self) -> JointType:
        """The record of its type."""
        return JOINT_TYPES[self.type]


@dataclass(frozen=True, kw_only=True)
class DeviceLoop:
    """What closes a loop between two bodies of a device."""

    type: Literal["revolute", "spherical", "rod"] = "revolute"
    """revolute: a pin, in the plane. In space spherical, a ball, and rod, a link without mass
    between two balls."""
    bodies: tuple[str, str]
    """The two bodies; may be "ground"."""
    at: tuple[Place, Place]
    """The two points, each in the frame of its body."""
    length: Length | None = None
    """Distance of the two points that a rod holds; required there."""


@dataclass(frozen=True, kw_only=True)
class Handle:
    """The point of a device that the hand holds, and the directions in which it is felt."""

    body: str
    """The body that it belongs to."""
    at: Place | None = None
    """Its position in the body's frame; by default its origin."""
    angle: Literal["held", "free", "fixed"] = "held"
    """held: the handle turns with its body, and moments are rendered; free: a point, whose angle
    belongs to nobody; fixed: the device does not let it turn, as a stage. In space the handle is a
    point, and three forces are rendered: leave it out."""
    along: tuple[Annotated[float, Quantity("1")], Annotated[float, Quantity("1")]] | None = None
    """Direction in the world of the one way of a device with one degree of freedom; by default x
    and y are felt."""

    def __post_init__(self) -> None:
        if self.along is not None and self.angle == "held":
            raise ValueError('handle: `along` is one direction of the plane: give angle = "free"')
        if self.along is not None and not math.hypot(*self.along) > 0.0:
            raise ValueError(f"handle: along = {list(self.along)} has no direction")


@dataclass(frozen=True, kw_only=True)
class Stops:
    """The stops at the limits of the workspace: a spring and damper that never pulls."""

    reach: Annotated[float, Quantity("1", gt=0.5, lt=1)] = 0.95
    """Fraction of the full reach of two links at which they begin: they are as far from its other
    limit, folded."""
    stiffness: LinearStiffness = 5000.0
    """Stiffness."""
    damping: LinearDamping = 20.0
    """Damping."""


@dataclass(frozen=True, kw_only=True)
class NumberOrigins:
    """Where the numbers of a device are from: each text begins with `printed`, `measured` or
    `assumed`, and says by whom."""

    lengths: str = ""
    """Of lengths and places of joints."""
    masses: str = ""
    """Of masses, centres and moments of inertia of bodies."""
    motors: str = ""
    """Of limits, ratios, inertias and friction of motors."""
    encoders: str = ""
    """Of resolutions of encoders."""

    def __post_init__(self) -> None:
        for key, text in vars(self).items():
            if text and not text.startswith(_ORIGINS):
                raise ValueError(f"{key} = {text!r} begins with none of {', '.join(_ORIGINS)}")


_ORIGINS = ("printed", "measured", "assumed")


@dataclass(frozen=True)
class DrivenJoint:
    """A joint with its motor, all of whose numbers are given."""

    joint: DeviceJoint
    torque_limit: float
    ratio: float
    inertia: float
    damping: float
    friction: float


@dataclass(frozen=True)
class SensedJoint:
    """A joint with its encoder."""

    joint: DeviceJoint
    resolution: float


@dataclass(frozen=True, kw_only=True)
class Device:
    """A linkage with motors and encoders. The keys are those of a device file; the ones that a
    scene writes are merged over it: [device files](device-file.md)."""

    title: str = ""
    """What the device is, in a few words."""
    description: str = ""
    """What else there is to say of it."""
    origin: NumberOrigins = field(default_factory=NumberOrigins)
    """Where its numbers are from."""
    body: tuple[DeviceBody, ...]
    """The bodies."""
    joint: tuple[DeviceJoint, ...]
    """The joints of the tree: every body is the child of exactly one."""
    loop: tuple[DeviceLoop, ...] = ()
    """What closes loops."""
    handle: Handle
    """What the hand holds."""
    base: Place = (0.0, 0.0)
    """Where the origin of the device's own frame stands in the world."""
    start: Mapping[str, Coordinate] = field(default_factory=dict)
    """Joint coordinates by the joint's name near which its loops are assembled, by default 0: they
    tell on which side each elbow is."""
    motor: Motor = field(default_factory=Motor)
    """What all motors have that do not say otherwise."""
    encoder: Encoder = field(default_factory=Encoder)
    """What all encoders have that do not say otherwise."""
    stop: Stops = field(default_factory=Stops)
    """The stops at the limits of its workspace."""
    substeps: Annotated[int, Quantity("1", ge=1, le=100)] = 1
    """Integration steps per communication step; the size of the FMU's equations grows with them."""
    observer: Observer = field(default_factory=Observer)
    """The observer, used with sensing = "encoders"."""
    driver: Driver | None = None
    """The board that takes the device's place in a run in real time, once it has a port."""

    def __post_init__(self) -> None:
        for j in self.joint:
            if j.motor and self._of(j.motor, self.motor, "torque_limit") is None:
                raise ValueError(f"joint {j.name!r}: give its motor a torque_limit (N.m)")
            if j.encoder and self._of(j.encoder, self.encoder, "resolution") is None:
                raise ValueError(f"joint {j.name!r}: give its encoder a resolution")
            if j.motor and self._of(j.motor, self.motor, "ratio") == 0.0:
                raise ValueError(f"joint {j.name!r}: ratio = 0 is a motor that moves nothing")

    def __hash__(self) -> int:
        return hash(repr(self))

    @staticmethod
    def _of(own: object, common: object, key: str) -> float | None:
        given: float | None = getattr(own, key, None)
        return getattr(common, key) if given is None else given

    @cached_property
    def placed(self) -> tuple[DeviceJoint, ...]:
        """The joints, with those on the ground where the device stands in the world."""
        return tuple(
            replace(j, at_parent=self._in_world(j.at_parent))
            if any(self.base) and j.parent == "ground"
            else j
            for j in self.joint
        )

    @cached_property
    def placed_loops(self) -> tuple[DeviceLoop, ...]:
        """What closes loops, likewise."""

        def moved(body: str, at: Place) -> Place:
            return self._in_world(at) if body == "ground" else at

        both = ((moved(c.bodies[0], c.at[0]), moved(c.bodies[1], c.at[1])) for c in self.loop)
        return tuple(replace(c, at=at) for c, at in zip(self.loop, both, strict=True))

    def _in_world(self, at: Place | None) -> Place:
        both = zip_longest(at or (0.0, 0.0), self.base, fillvalue=0.0)
        return cast("Place", tuple(a + b for a, b in both))

    @cached_property
    def motors(self) -> tuple[DrivenJoint, ...]:
        """The joints with a motor, in their order."""
        default = {"ratio": 1.0, "inertia": 0.0, "damping": 0.0, "friction": 0.0}
        found = []
        for j in (j for j in self.placed if j.motor):
            given = {key: self._of(j.motor, self.motor, key) for key in ("torque_limit", *default)}
            filled = {k: default.get(k, 0.0) if v is None else v for k, v in given.items()}
            found.append(DrivenJoint(j, **filled))
        return tuple(found)

    @cached_property
    def encoders(self) -> tuple[SensedJoint, ...]:
        """The joints with an encoder, in their order."""
        sensed = (j for j in self.placed if j.encoder)
        return tuple(
            SensedJoint(j, self._of(j.encoder, self.encoder, "resolution") or 0.0) for j in sensed
        )

    @property
    def is_light(self) -> bool:
        """Whether its bodies weigh less in all than a device that a mechanism is felt through as it
        is."""
        return sum(body.mass for body in self.body) < LIGHT

    @property
    def torque_limit(self) -> float:
        """The largest torque (N.m) that each of its motors can give."""
        return min(motor.torque_limit for motor in self.motors)

    @property
    def space(self) -> PortSpace:
        """That of the port at the handle."""
        return self.linkage.space

    @cached_property
    def linkage(self) -> Linkage:
        """Its bodies, joints and loops, held at the handle."""
        keys = ("name", "type", "parent", "child", "at_parent", "at_child", "axis")
        return Linkage(
            body=tuple(Body(**vars(b)) for b in self.body),
            joint=tuple(Joint(**{key: getattr(j, key) for key in keys}) for j in self.placed),
            loop=tuple(Loop(**vars(c)) for c in self.placed_loops),
            operational_point=OperationalPoint(body=self.handle.body, at=self.handle.at),
            start=self.start,
        )
