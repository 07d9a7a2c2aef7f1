"""[linkage], [mechanism], [directions] and the graphics copy, as a scene writes them.

Frozen records into which a scene file's tables are read. What a scene mentions is structure: a
field that is None adds no term to the equations; one with a value, even 0, is a parameter of the
FMU. SI units throughout.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Literal

from hapticlink.components.integrators import METHODS
from hapticlink.components.port_space import PLANE, POINT, PortSpace
from hapticlink.components.specs.bodies import Body
from hapticlink.components.specs.drives import Drive
from hapticlink.components.specs.joint_types import (
    JOINT_TYPES,
    CutType,
    Freedom,
    JointType,
    TreeType,
)
from hapticlink.components.specs.quantities import (
    Angle,
    Coordinate,
    Damping,
    Direction,
    JointDamping,
    JointStiffness,
    Length,
    LinearDamping,
    LinearStiffness,
    Place,
    Pose,
    Quantity,
    Stiffness,
    Substeps,
)

Acceleration = Annotated[float, Quantity("m/s2")]
Velocity = Annotated[float, Quantity("rad/s or m/s")]
LinearVelocity = Annotated[float, Quantity("m/s")]
Twist = tuple[LinearVelocity, LinearVelocity, Annotated[float, Quantity("rad/s")]]
Two = tuple[Coordinate, Coordinate]
Six = tuple[Coordinate, Coordinate, Coordinate, Coordinate, Coordinate, Coordinate]
TwoRates = tuple[Velocity, Velocity]
SixRates = tuple[Velocity, Velocity, Velocity, Velocity, Velocity, Velocity]
Start = Coordinate | Pose | Two | Six


@dataclass(frozen=True, kw_only=True)
class Spring:
    """A spring and damper between two points of bodies."""

    bodies: tuple[str, str]
    """The two bodies; may be "ground"."""
    at: tuple[Place, Place]
    """The two points, each in the frame of its body."""
    stiffness: LinearStiffness | None = None
    """Stiffness; by default there is no spring."""
    damping: LinearDamping | None = None
    """Damping; by default there is no damper."""
    length: Annotated[float, Quantity("m", ge=0)] | None = None
    """Free length; with one the damping acts along the line through the points only. By default 0,
    and the damping acts in all directions."""
    name: str | None = None
    """Prefix of its FMU parameters; by default spring1, spring2, ..."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Ends of a joint's range, as contacts: a spring and damper that pushes back beyond them and
    never pulls. Without damping and restitution the joint turns back with all its energy."""

    lower: Coordinate | None = None
    """Lower end of the range; by default there is none."""
    upper: Coordinate | None = None
    """Upper end of the range; by default there is none."""
    stiffness: Annotated[float, Quantity("N.m/rad or N/m", gt=0)]
    """Stiffness of the ends."""
    damping: JointDamping | None = None
    """Damping of the ends; or give `restitution`."""
    restitution: Annotated[float, Quantity("1", ge=0.01, le=1)] | None = None
    """Rate after an impact by rate before it: the damping is that for the joint's inertia at its
    pose, with the loops closed."""


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint of the tree.

    Stiffness, damping, friction and a drive act on the coordinate of a joint that has one:
    -stiffness (q - rest) - damping q' - friction + drive.
    """

    name: str
    """Its name in start values."""
    type: TreeType = "revolute"
    """revolute: one angle; prismatic: one displacement along `axis`; free: x, y and theta of the
    child in the parent's frame. [In space](space.md): universal, spherical, cylindrical and
    floating."""
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
    space the axis of a joint that turns or slides, three numbers in the parent's frame; by default
    its z axis."""
    second_axis: Direction | None = None
    """Second axis of a universal joint, in the child's frame; required there."""
    stiffness: JointStiffness | None = None
    """Stiffness of a spring about `rest`."""
    rest: Coordinate | None = None
    """Coordinate at which the spring is at rest; by default 0."""
    damping: JointDamping | None = None
    """Viscous damping."""
    friction: Annotated[float, Quantity("N.m or N", ge=0)] | None = None
    """Coulomb friction, up to which the joint sticks."""
    friction_speed: Annotated[float, Quantity("rad/s or m/s", gt=0)] | None = None
    """Sets the damping of a joint that sticks, friction / friction_speed; by default as large as an
    integration step resolves."""
    friction_deflection: Annotated[float, Quantity("rad or m", gt=0)] | None = None
    """Deflection at which a joint begins to slide: sets the stiffness of one that sticks,
    friction / friction_deflection; by default as large as an integration step resolves."""
    limits: Limits | None = None
    """Ends of the range of a joint of one coordinate."""
    drive: Drive | None = None
    """A motor."""
    ports: tuple[Literal["effort", "position", "velocity"], ...] = ()
    """Ports of the mechanism's FMU for a motor or controller outside: NAME.effort is an input,
    NAME.position and NAME.velocity are outputs."""

    @property
    def kind(self) -> JointType:
        """The record of its type."""
        return JOINT_TYPES[self.type]

    def direction(self, freedom: Freedom) -> tuple[float, float]:
        """Of a slide of the joint in the plane, in the parent's frame: a unit vector."""
        if isinstance(freedom.along, tuple):
            return freedom.along[0], freedom.along[1]
        return math.cos(self.axis_angle), math.sin(self.axis_angle)

    @property
    def axis_angle(self) -> float:
        """The `axis` of a joint in the plane, from the x axis (rad)."""
        return 0.0 if self.axis is None or isinstance(self.axis, tuple) else self.axis


@dataclass(frozen=True, kw_only=True)
class Loop:
    """A cut joint, which closes a loop between two bodies."""

    type: CutType = "revolute"
    """revolute: the two points coincide; slot: the first body's point, a pin, is on the line
    through the second body's point along `axis`; prismatic: a slot in which the first body does
    not turn relative to the second. [In space](space.md): universal, spherical, cylindrical and
    rod, which holds the distance of the points."""
    bodies: tuple[str, str]
    """The two bodies; may be "ground"."""
    at: tuple[Place, Place]
    """The two points, each in the frame of its body."""
    axis: Angle | None = None
    """Direction of a slot or prismatic joint in the second body's frame, from its x axis; required
    there."""
    axes: tuple[Direction, Direction] | None = None
    """In space: the axes of the joint, in the first body's frame and in that of the second; by
    default their z axes. Those of a universal joint are square, all others parallel."""
    length: Length | None = None
    """Distance of the two points that a rod holds; required there."""
    angle: Angle | None = None
    """Angle of the first body from the second in a prismatic joint; by default 0."""
    name: str | None = None
    """Prefix of its FMU parameters; by default loop1, loop2, ..."""
    stiffness: JointStiffness | None = None
    """As of a joint, on the coordinate of a cut one: the angle of the first body from the second (0
    where their x axes are parallel; full turns count), or the displacement of the first point from
    the second along `axis`."""
    rest: Coordinate | None = None
    """As of a joint."""
    damping: JointDamping | None = None
    """As of a joint."""
    friction: Annotated[float, Quantity("N.m or N", ge=0)] | None = None
    """As of a joint."""
    friction_speed: Annotated[float, Quantity("rad/s or m/s", gt=0)] | None = None
    """As of a joint."""
    friction_deflection: Annotated[float, Quantity("rad or m", gt=0)] | None = None
    """As of a joint."""
    limits: Limits | None = None
    """As of a joint."""
    drive: Drive | None = None
    """As of a joint."""

    @property
    def kind(self) -> JointType:
        """The record of its type."""
        return JOINT_TYPES[self.type]


@dataclass(frozen=True, kw_only=True)
class Gear:
    """A rigid coupling of two joint coordinates, q_0 = ratio q_1 + offset: gears, belt or rack."""

    joints: tuple[str, str]
    """The two joints, of one coordinate each."""
    ratio: Annotated[float, Quantity("1, m/rad or rad/m")]
    """Change of the first coordinate for a unit change of the second; negative for outer gears."""
    offset: Coordinate | None = None
    """The first coordinate where the second is 0; by default that of `start`."""
    name: str | None = None
    """Prefix of its FMU parameters; by default gear1, gear2, ..."""


NO_POINT = "none"
"""What stands for the name of a point where the hand holds none."""


@dataclass(frozen=True, kw_only=True)
class OperationalPoint:
    """The point that the hand holds."""

    body: str
    """The body that it belongs to."""
    at: Place | None = None
    """Its position in the body's frame; by default its origin."""


@dataclass(frozen=True, kw_only=True)
class FurtherPoint(OperationalPoint):
    """Another operational point, for a hand of its own."""

    name: str
    """Its name in [hands] and in the FMU's ports."""


@dataclass(frozen=True, kw_only=True)
class Linkage:
    """Bodies, a tree of joints, and the cut joints that close loops."""

    body: tuple[Body, ...]
    """The bodies."""
    joint: tuple[Joint, ...]
    """The joints of the tree: every body is the child of exactly one."""
    operational_point: OperationalPoint | str
    """The point that the hand holds, or the name of one of `points`."""
    points: Mapping[str, OperationalPoint] = field(default_factory=dict)
    """Points by name, between which the hand can change:
    [another link](mechanisms.md#another-link-in-the-hand)."""
    point: tuple[FurtherPoint, ...] = ()
    """Further operational points, for further hands."""
    loop: tuple[Loop, ...] = ()
    """Cut joints that close loops."""
    gear: tuple[Gear, ...] = ()
    """Couplings of joint coordinates."""
    spring: tuple[Spring, ...] = ()
    """Springs and dampers between points of bodies."""
    force: tuple[Any, ...] = ()
    """Forces of your own: `type` is a name that a plugin has registered, which defines the other
    keys ([extending](extending.md#a-force))."""
    gravity: (
        tuple[Acceleration, Acceleration] | tuple[Acceleration, Acceleration, Acceleration] | None
    ) = None
    """Gravity on every body; three numbers in space."""
    start: Mapping[str, Start] = field(default_factory=dict)
    """Joint coordinates at t = 0 by the joint's name, by default 0; as many as the joint has, three
    for a free joint. Assembly changes them so that the loops close."""
    start_velocity: Mapping[str, Velocity | Twist | TwoRates | SixRates] = field(
        default_factory=dict
    )
    """Joint velocities at t = 0 by the joint's name; three for a free joint. Given ones are kept;
    the others are the smallest that are consistent with the loops."""

    @property
    def held(self) -> OperationalPoint:
        """The operational point at the start."""
        point = self.operational_point
        return self.points[point] if isinstance(point, str) else point

    @property
    def choices(self) -> tuple[str, ...]:
        """The names of the points between which the hand can change in the order of their numbers,
        from 1, which is that of the alphabet; none of a single one."""
        return tuple(sorted(self.points)) if len(self.points) > 1 else ()

    @property
    def held_name(self) -> str:
        """The prefix of the parameters of `held`."""
        point = self.operational_point
        return point if isinstance(point, str) and self.choices else "operational_point"

    @cached_property
    def spatial(self) -> str:
        """What makes it one in space: a type of joint, or a vector of more numbers than two; "" in
        the plane."""
        for j in self._joints:
            if not j.kind.in_plane:
                return f"a {j.type} joint"
        points = [*self.points.values(), *self.point]
        if not isinstance(self.operational_point, str):
            points.append(self.operational_point)
        pairs: tuple[Loop | Spring, ...] = (*self.loop, *self.spring)
        vectors: dict[str, Iterable[object]] = {
            "at_parent": (j.at_parent for j in self.joint),
            "at_child": (j.at_child for j in self.joint),
            "axis": (j.axis for j in self.joint),
            "second_axis": (j.second_axis for j in self.joint),
            "axes": (axis for loop in self.loop for axis in loop.axes or ()),
            "at": (at for pair in pairs for at in pair.at),
            "center": (body.center for body in self.body),
            "inertia": (body.inertia for body in self.body),
            "at of a point": (point.at for point in points),
            "gravity": (self.gravity,),
        }
        for name, values in vectors.items():
            if any(isinstance(value, tuple) and len(value) > 2 for value in values):
                return f"three numbers of {name}"
        return ""

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return 3 if self.spatial else 2

    @property
    def space(self) -> PortSpace:
        """That of the ports at its operational points."""
        return PLANE if self.dimension == 2 else POINT

    @property
    def coordinate_units(self) -> tuple[str, ...]:
        """The units of the joint coordinates, n of them."""
        return tuple(unit for j in self.joint for unit in j.kind.units)

    @property
    def rate_units(self) -> tuple[str, ...]:
        """The units of their rates."""
        return tuple(f"{unit}/s" for unit in self.coordinate_units)

    @property
    def closed(self) -> bool:
        """Whether it has closures: loops or gears."""
        return bool(self.loop or self.gear)

    @property
    def free(self) -> set[str]:
        """The bodies on a free joint that are in no loop."""
        looped = {name for loop in self.loop for name in loop.bodies}
        return {j.child for j in self.joint if j.kind.free} - looped

    @property
    def objects(self) -> set[str]:
        """The free bodies that no hand holds and that carry no other body: movable objects."""
        held = {point.body for point in (self.held, *self.points.values(), *self.point)}
        return self.free - held - {j.parent for j in self.joint}

    @property
    def _joints(self) -> tuple[Joint | Loop, ...]:
        return (*self.joint, *self.loop)

    @property
    def limited(self) -> bool:
        """Whether a joint or a cut joint has limits."""
        return any(j.limits for j in self._joints)

    @property
    def driven(self) -> bool:
        """Whether a joint or a cut joint has a drive."""
        return any(j.drive for j in self._joints)

    @property
    def rubbing(self) -> int:
        """The number of joints and cut joints with friction."""
        return sum(j.friction is not None for j in self._joints)

    @property
    def sprung(self) -> bool:
        """Whether there are springs and dampers, between points or on joints."""
        given = [value for j in self._joints for value in (j.stiffness, j.damping)]
        return bool(self.spring) or any(value is not None for value in given)


@dataclass(frozen=True, kw_only=True)
class Directions:
    """Detection of constrained directions by the eigenvalues of S Lambda^-1 S with
    S = diag(1, 1, length_scale)."""

    length_scale: Length | None = None
    """L, makes rotations comparable with translations; by default the mean link length."""
    rank_tolerance: Annotated[float, Quantity("1", gt=0, lt=1)] = 0.1
    """A direction is constrained if its eigenvalue is below this fraction of the largest one."""
    hysteresis: Annotated[float, Quantity("1", ge=1)] = 1.5
    """A direction stays constrained until that fraction exceeds this times `rank_tolerance`."""


@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """Time integration of the virtual mechanism."""

    integrator: Annotated[str, METHODS.names()] = "rk4"
    """Integration method."""
    stabilization: Literal["none", "baumgarte", "projection"] = "projection"
    """Stabilisation of the loop closures."""
    directions: bool = False
    """Adds the outputs Lambda_inv, P_c and n_constraints at the mechanism's own rate."""
    diagnostics: bool = False
    """Adds outputs for rank and condition of the closures."""
    alpha: Annotated[float, Quantity("1/s", ge=0)] | None = None
    """Baumgarte's frequency of (3.3); the default depends on the integrator."""
    beta: Annotated[float, Quantity("1", ge=0)] | None = None
    """Baumgarte's damping ratio of (3.3); the default depends on the integrator."""
    substeps: Substeps = 1
    """Integration steps per communication step."""
    events: Annotated[int, Quantity("1", ge=0, le=4)] = 1
    """Begins and ends of contacts that are located within an integration step."""


@dataclass(frozen=True, kw_only=True)
class GraphicsCopy:
    """The graphics-rate copy, and how it follows the mechanism (section B.6)."""

    sync: Literal["exact", "operational", "joint"] = "exact"
    """exact: the copy takes the mechanism's coordinates, projected onto the closures; operational:
    a PD controller pulls it at the operational point (the report), and it may fold to the other
    assembly; joint: it is pulled at every joint coordinate."""
    stiffness: Stiffness = (1000.0, 1000.0, 10000.0)
    """K_g, on the operational pose."""
    damping: Damping = (100.0, 100.0, 10000.0)
    """B_g, on the operational velocity."""
    joint_stiffness: Annotated[float, Quantity("1/s2", ge=0)] = 1e4
    """Joint acceleration for an error of the joint coordinate, with sync = "joint"."""
    joint_damping: Annotated[float, Quantity("1/s", ge=0)] = 200.0
    """Joint acceleration for an error of the joint velocity, with sync = "joint"."""
    substeps: Substeps = 20
    """Integration steps per frame, where the copy is pulled."""


def coordinates(linkage: Linkage, values: Mapping[str, float | Sequence[float]]) -> list[float]:
    """Flat joint coordinates from values by joint name; missing ones are 0."""
    flat: list[float] = []
    for j in linkage.joint:
        value = values.get(j.name, (0.0,) * j.kind.size)
        flat.extend(value if isinstance(value, Sequence) else (value,))
    return flat
