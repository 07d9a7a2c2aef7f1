"""What can be said of a linkage and of how it is simulated, with every default, once.

Plain frozen records: a scene file's tables are read straight into them. Structure is what a scene
mentions: a field left at None has no term in the equations; one given, even as 0, is a parameter of
the FMU. SI units throughout.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from hapticlink.components.integrators import METHODS
from hapticlink.components.specs.quantities import (
    Angle,
    Coordinate,
    Damping,
    Effort,
    JointDamping,
    JointStiffness,
    Length,
    LinearDamping,
    LinearStiffness,
    Mass,
    MomentOfInertia,
    Point,
    Pose,
    Quantity,
    Stiffness,
    Substeps,
    Time,
)

Acceleration = Annotated[float, Quantity("m/s2")]
Velocity = Annotated[float, Quantity("rad/s or m/s")]
LinearVelocity = Annotated[float, Quantity("m/s")]
Twist = tuple[LinearVelocity, LinearVelocity, Annotated[float, Quantity("rad/s")]]


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body. With a radius it can touch obstacles: as a capsule, or as a disc."""

    name: str
    """By which joints, loops and points speak of it; none is "ground"."""
    mass: Mass
    """Mass; 0 only for a body in a loop whose motion other masses determine."""
    inertia: MomentOfInertia
    """Moment of inertia about the centre of mass."""
    center: Point | None = None
    """Centre of mass in the body's frame; its origin where left out."""
    radius: Length | None = None
    """Radius of the body's shape. Without one it touches nothing."""
    capsule: tuple[Point, ...] = ((0.0, 0.0),)
    """Ends of the axis of the body's shape, in its frame; one point for a disc."""


@dataclass(frozen=True, kw_only=True)
class ConstantDrive:
    """A constant effort on a joint."""

    type: Literal["constant"] = "constant"
    """A constant effort."""
    effort: Effort
    """Torque of a revolute joint, force of a prismatic one."""


@dataclass(frozen=True, kw_only=True)
class ProfileDrive:
    """An effort from a table."""

    type: Literal["profile"] = "profile"
    """An effort from a table."""
    table: tuple[tuple[Time, Effort], ...]
    """Rows of time and effort, sorted by time; linear between rows, the ends held."""


@dataclass(frozen=True, kw_only=True)
class PDDrive:
    """A servo: stiffness (target - q) + damping (target' - q')."""

    type: Literal["pd"] = "pd"
    """A servo that follows a target."""
    table: tuple[tuple[Time, Coordinate], ...]
    """Rows of time and target, sorted by time; linear between rows, the ends held."""
    stiffness: JointStiffness
    """Gain on the position error."""
    damping: JointDamping
    """Gain on the velocity error."""


Drive = ConstantDrive | ProfileDrive | PDDrive


@dataclass(frozen=True, kw_only=True)
class Spring:
    """A spring and damper between two points of bodies."""

    bodies: tuple[str, str]
    """The two bodies; "ground" is one."""
    at: tuple[Point, Point]
    """The two points, each in the frame of its body."""
    stiffness: LinearStiffness | None = None
    """Stiffness; no spring where left out."""
    damping: LinearDamping | None = None
    """Damping; no damper where left out."""
    length: Annotated[float, Quantity("m", ge=0)] | None = None
    """Free length. Where left out it is 0, and the damping acts across the line through the points
    too, not along it alone."""
    name: str | None = None
    """Prefix of its FMU parameters; spring1, spring2, ... where left out."""


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint of the tree.

    Stiffness, damping, friction and a drive act on the one coordinate of a revolute or prismatic
    joint: -stiffness (q - rest) - damping q' - friction tanh(q'/friction_speed) + drive.
    """

    name: str
    """By which start values speak of it."""
    type: Literal["revolute", "prismatic", "free"] = "revolute"
    """revolute: one angle; prismatic: one displacement along `axis`; free: x, y and theta of the
    child in the parent's frame."""
    parent: str = "ground"
    """The body that carries the joint."""
    child: str
    """The body that the joint carries."""
    at_parent: Point | None = None
    """Where the joint is in the parent's frame; its origin where left out."""
    at_child: Point | None = None
    """Where the joint is in the child's frame; its origin where left out."""
    axis: Angle | None = None
    """Direction of a prismatic joint in the parent's frame, from its x axis; required there."""
    stiffness: JointStiffness | None = None
    """Stiffness of a spring about `rest`."""
    rest: Coordinate | None = None
    """Coordinate at which the spring is at rest; 0 where left out."""
    damping: JointDamping | None = None
    """Viscous damping."""
    friction: Annotated[float, Quantity("N.m or N", ge=0)] | None = None
    """Coulomb friction."""
    friction_speed: Annotated[float, Quantity("rad/s or m/s", gt=0)] = 0.01
    """Speed over which Coulomb friction saturates."""
    drive: Drive | None = None
    """A motor."""


@dataclass(frozen=True, kw_only=True)
class Loop:
    """A cut revolute joint, which closes a loop: two points of two bodies that stay together."""

    bodies: tuple[str, str]
    """The two bodies; "ground" is one."""
    at: tuple[Point, Point]
    """The two points, each in the frame of its body."""
    name: str | None = None
    """Prefix of its FMU parameters; loop1, loop2, ... where left out."""


@dataclass(frozen=True, kw_only=True)
class OperationalPoint:
    """The point that the hand holds."""

    body: str
    """The body that it is a point of."""
    at: Point | None = None
    """Where it is in the body's frame; its origin where left out."""


@dataclass(frozen=True, kw_only=True)
class FurtherPoint(OperationalPoint):
    """Another operational point, for a hand of its own."""

    name: str
    """By which [hands] and the FMU's ports speak of it."""


@dataclass(frozen=True, kw_only=True)
class Linkage:
    """Bodies, a tree of joints, and the cut joints that close loops."""

    body: tuple[Body, ...]
    """The bodies."""
    joint: tuple[Joint, ...]
    """The joints of the tree: every body is the child of one."""
    operational_point: OperationalPoint
    """The point that the hand holds."""
    point: tuple[FurtherPoint, ...] = ()
    """Further operational points, for more hands than one."""
    loop: tuple[Loop, ...] = ()
    """Cut joints that close loops."""
    spring: tuple[Spring, ...] = ()
    """Springs and dampers between points of bodies."""
    force: tuple[Any, ...] = ()
    """Forces of your own: each `type` is a name that a plugin has registered, which says the other
    keys ([extending](extending.md#a-force))."""
    gravity: tuple[Acceleration, Acceleration] | None = None
    """Gravity on every body."""
    start: Mapping[str, Coordinate | Pose] = field(default_factory=dict)
    """Joint coordinates at t = 0 by the joint's name, 0 where left out; three for a free joint.
    Assembly moves them onto the loop closures."""
    start_velocity: Mapping[str, Velocity | Twist] = field(default_factory=dict)
    """Joint velocities at t = 0 by the joint's name; three for a free joint. They are kept; those
    left out are the least that the loops allow."""


@dataclass(frozen=True, kw_only=True)
class Directions:
    """How constrained directions are told from free ones, by the eigenvalues of S Lambda^-1 S with
    S = diag(1, 1, length_scale)."""

    length_scale: Length | None = None
    """Makes rotations comparable with translations; the mean link length where left out."""
    rank_tolerance: Annotated[float, Quantity("1", gt=0, lt=1)] = 0.1
    """A direction is constrained where its share of the largest eigenvalue falls below this."""
    hysteresis: Annotated[float, Quantity("1", ge=1)] = 1.5
    """A direction stays constrained until its share exceeds this times `rank_tolerance`."""


@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """Time integration of the virtual mechanism."""

    integrator: Annotated[str, METHODS.names()] = "rk4"
    """Integration method."""
    formulation: Literal["multipliers", "partitioning", "embedding"] = "multipliers"
    """How loops enter (section B.2): by multipliers with a stabilization, or by independent
    coordinates alone, which need none."""
    stabilization: Literal["none", "baumgarte", "projection"] = "projection"
    """What keeps the loops closed."""
    directions: bool = False
    """Puts out Lambda_inv, P_c and n_constraints at the mechanism's own rate."""
    diagnostics: bool = False
    """Puts out rank and condition of the closures."""
    alpha: Annotated[float, Quantity("1/s", ge=0)] | None = None
    """Baumgarte's frequency of (3.3); where left out, what suits the integrator."""
    beta: Annotated[float, Quantity("1", ge=0)] | None = None
    """Baumgarte's damping ratio of (3.3); where left out, what suits the integrator."""
    substeps: Substeps = 1
    """Integration steps within a communication step."""


@dataclass(frozen=True, kw_only=True)
class GraphicsCopy:
    """The graphics-rate copy, and how it follows the mechanism (section B.6)."""

    sync: Literal["exact", "operational", "joint"] = "exact"
    """exact: the copy takes the mechanism's coordinates, moved onto the closures; operational: a PD
    controller pulls it at the operational pose (the report), and it may fold to the other assembly
    of links; joint: it is pulled at every joint coordinate."""
    stiffness: Stiffness = (1000.0, 1000.0, 10000.0)
    """K_g, on the operational pose."""
    damping: Damping = (100.0, 100.0, 10000.0)
    """B_g, on the operational velocity."""
    joint_stiffness: Annotated[float, Quantity("1/s2", ge=0)] = 1e4
    """Joint acceleration for an error of the joint coordinate, with sync = "joint"."""
    joint_damping: Annotated[float, Quantity("1/s", ge=0)] = 200.0
    """Joint acceleration for an error of the joint velocity, with sync = "joint"."""
    substeps: Substeps = 20
    """Integration steps within a frame, of the pulls."""
