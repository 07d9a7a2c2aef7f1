"""What can be said of each component, with every default, once.

Plain frozen records: a scene file's tables are read straight into them. Structure is
what a scene mentions: a field left at None has no term in the equations; one given, even
as 0, is a parameter of the FMU. SI units throughout.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

Point = tuple[float, float]
Vector3 = tuple[float, float, float]
# The units of the three, x, y and theta, for what reads the annotations.
Wrench = Annotated[Vector3, "N, N, N.m"]
Stiffness = Annotated[Vector3, "N/m, N/m, N.m/rad"]
Damping = Annotated[Vector3, "N.s/m, N.s/m, N.m.s/rad"]
Inertia = Annotated[Vector3, "kg, kg, kg.m2"]


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body: mass (kg), inertia about its centre of mass (kg.m2), centre (m).

    Where it can touch: a capsule of `radius` (m) between the two points `capsule` (m, in its
    frame), or a disc about one point."""

    name: str
    mass: float
    inertia: float
    center: Point | None = None
    radius: float | None = None
    capsule: tuple[Point, ...] = ((0.0, 0.0),)


@dataclass(frozen=True, kw_only=True)
class ConstantDrive:
    """A constant effort (N or N.m) on a joint."""

    type: Literal["constant"] = "constant"
    effort: float


@dataclass(frozen=True, kw_only=True)
class ProfileDrive:
    """An effort from rows (t s, N or N.m), linear between rows, the ends held."""

    type: Literal["profile"] = "profile"
    table: tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class PDDrive:
    """A servo: stiffness (target - q) + damping (target' - qd); rows (t s, target rad or m)."""

    type: Literal["pd"] = "pd"
    table: tuple[tuple[float, float], ...]
    stiffness: float
    damping: float


Drive = ConstantDrive | ProfileDrive | PDDrive


@dataclass(frozen=True, kw_only=True)
class Spring:
    """A spring and damper (N/m, N.s/m) of free length `length` (m) between two points of
    bodies (m, in their frames); "ground" is a body."""

    bodies: tuple[str, str]
    at: tuple[Point, Point]
    stiffness: float | None = None
    damping: float | None = None
    length: float | None = None
    name: str | None = None


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint of the tree; at_parent and at_child (m) in the frames of the two bodies.

    revolute: one angle; prismatic: one displacement along `axis` of the parent's frame,
    a direction in rad; free: x, y and theta of the child in the parent's frame.

    On one coordinate also: stiffness about `rest` and viscous damping (N.m/rad, N.m.s/rad or
    N/m, N.s/m), Coulomb friction (N.m or N) that saturates over `friction_speed` (rad/s or
    m/s), and a drive.
    """

    name: str
    type: Literal["revolute", "prismatic", "free"] = "revolute"
    parent: str = "ground"
    child: str
    at_parent: Point | None = None
    at_child: Point | None = None
    axis: float | None = None
    stiffness: float | None = None
    rest: float | None = None
    damping: float | None = None
    friction: float | None = None
    friction_speed: float = 0.01
    drive: Drive | None = None


@dataclass(frozen=True, kw_only=True)
class Loop:
    """A cut revolute joint: the point at[0] of bodies[0] stays on at[1] of bodies[1] (m)."""

    bodies: tuple[str, str]
    at: tuple[Point, Point]
    name: str | None = None


@dataclass(frozen=True, kw_only=True)
class OperationalPoint:
    """The point of a body (m, in its frame) that the hand holds."""

    body: str
    at: Point | None = None


@dataclass(frozen=True, kw_only=True)
class FurtherPoint(OperationalPoint):
    """Another operational point, for a hand of its own."""

    name: str


@dataclass(frozen=True, kw_only=True)
class Linkage:
    """Bodies, a tree of joints, and the cut joints that close loops; `point` are further
    operational points, for more hands than one.

    gravity (m/s2) acts on every body. start and start_velocity give joint coordinates by joint
    name (rad or m; a free joint takes three numbers); what is missing is 0.
    """

    body: tuple[Body, ...]
    joint: tuple[Joint, ...]
    operational_point: OperationalPoint
    point: tuple[FurtherPoint, ...] = ()
    loop: tuple[Loop, ...] = ()
    spring: tuple[Spring, ...] = ()
    gravity: Point | None = None
    start: Mapping[str, float | Vector3] = field(default_factory=dict)
    start_velocity: Mapping[str, float | Vector3] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Directions:
    """How resisted directions are told from free ones.

    length_scale (m) makes rotations comparable with translations; None takes the mean
    link length. rank_tolerance: a direction is resisted where its share of the largest
    eigenvalue of S Lambda^-1 S falls below it, until it exceeds hysteresis times it.
    """

    length_scale: float | None = None
    rank_tolerance: float = 0.1
    hysteresis: float = 1.5


@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """Time integration of the virtual mechanism.

    formulation says how loops enter (section B.2): by multipliers with a stabilization, or by
    independent coordinates alone, which need none. alpha (1/s) and beta are Baumgarte's; None
    takes the integrator's own, which needs no number from the user. directions adds the outputs
    Lambda_inv, P_c and n_constraints at the mechanism's own rate; diagnostics adds rank and
    condition of the closures.
    """

    integrator: Literal[
        "semi-implicit-euler", "heun", "linearly-implicit", "rk4", "dormand-prince-8"
    ] = "rk4"
    formulation: Literal["multipliers", "partitioning", "embedding"] = "multipliers"
    stabilization: Literal["none", "baumgarte", "projection"] = "projection"
    directions: bool = False
    diagnostics: bool = False
    alpha: float | None = None
    beta: float | None = None
    substeps: int = 1


@dataclass(frozen=True, kw_only=True)
class GraphicsCopy:
    """The graphics-rate copy and the PD graphics controller that pulls it.

    stiffness K_g (N/m, N/m, N.m/rad) and damping B_g as section B.6 prints them. sync
    "operational" pulls the operational pose (the report), "joint" every joint coordinate, as
    an acceleration joint_stiffness (1/s2) times the error and joint_damping (1/s) its rate.
    """

    sync: Literal["operational", "joint"] = "operational"
    stiffness: Stiffness = (1000.0, 1000.0, 10000.0)
    damping: Damping = (100.0, 100.0, 10000.0)
    joint_stiffness: float = 1e4
    joint_damping: float = 200.0
    substeps: int = 20
