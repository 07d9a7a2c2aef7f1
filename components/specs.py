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


@dataclass(frozen=True, kw_only=True)
class Observer:
    """Nicosia observer: bandwidth omega_n (rad/s), output gain k_D (1/s), and the rule of
    section 1.3.1 that discretises it."""

    rule: Literal["forward", "backward", "trapezoidal"] = "backward"
    omega_n: float = 50.0
    k_D: float = 100.0


@dataclass(frozen=True, kw_only=True)
class Device:
    """Twin pantograph. The report gives no dimensions: every number here is assumed.

    Two five-bars in parallel planes, A and B, hold the ends of a crank of length `crank`
    at p -+ (crank/2)(cos theta, sin theta). Base joints at (base_x -+ base_half_width,
    base_y_a) and (..., base_y_b), elbows outward. Lengths m, masses kg, inertias kg.m2,
    centres as distances (m) from the joint nearer the base; limits N.m.
    """

    proximal_length: float = 0.16
    distal_length: float = 0.20
    crank: float = 0.08
    base_x: float = -0.005
    base_half_width: float = 0.03
    base_y_a: float = -0.20
    base_y_b: float = 0.20
    rotor_inertia: float = 1.4e-5
    proximal_mass: float = 0.05
    proximal_center: float = 0.07
    proximal_inertia: float = 1.07e-4
    distal_mass: float = 0.035
    distal_center: float = 0.10
    distal_inertia: float = 1.17e-4
    handle_mass: float = 0.12
    handle_inertia: float = 8e-5
    torque_limit: float = 0.5
    encoder_resolution: float = 0.0015707963267948967
    reach_limit: float = 0.95
    stop_stiffness: float = 5000.0
    stop_damping: float = 20.0
    substeps: int = 1
    sensing: Literal["ideal", "encoders"] = "ideal"
    observer: Observer = field(default_factory=Observer)


@dataclass(frozen=True, kw_only=True)
class Topology:
    """Topology (joint-constraint) controller: k_j (N/m/kg), b_j (N/(m/s)/kg).

    form "plain" is M_d P_c (k_j e + b_j edot), for comparison only: it leaks onto free
    motion and depends on the length scale.
    """

    stiffness: float = 200.0
    damping: float = 50.0
    form: Literal["constrained", "plain"] = "constrained"


@dataclass(frozen=True, kw_only=True)
class Teleoperation:
    """Position channels of the four-channel controller: K_pc and B_pc of section B.6."""

    stiffness: Stiffness = (100.0, 100.0, 0.5)
    damping: Damping = (70.0, 70.0, 0.375)


@dataclass(frozen=True, kw_only=True)
class Controller:
    """The controller block; a part that is False or None is left out.

    bias "full" adds M_d a_bias, the mechanism's velocity, gravity and drive terms, to the
    impedance law; "none" is the report. damping B_d and stiffness K_d (about the starting
    pose) are the desired ones of (4.1).
    """

    impedance: bool = True
    bias: Literal["none", "full"] = "none"
    damping: Damping | None = None
    stiffness: Stiffness | None = None
    teleoperation: Teleoperation | Literal[False] = field(default_factory=Teleoperation)
    topology: Topology | bool = True
    contact: bool = False


@dataclass(frozen=True, kw_only=True)
class ConstantHand:
    """A constant wrench (N, N, N.m) at the handle, with an optional damping to ground."""

    type: Literal["constant"] = "constant"
    wrench: Wrench
    damping: Damping | None = None


@dataclass(frozen=True, kw_only=True)
class ProfileHand:
    """A wrench read from a table of rows (t s, N, N, N.m), linear between rows, held after."""

    type: Literal["profile"] = "profile"
    table: tuple[tuple[float, float, float, float], ...]
    damping: Damping | None = None


@dataclass(frozen=True, kw_only=True)
class ArmHand:
    """An arm behind a grip: mass M_a held to a target path by K_a, B_a, and to the handle by
    the grip's K_gr, B_gr. target: rows (t s, x m, y m, theta rad), linear, held after."""

    type: Literal["arm"] = "arm"
    mass: Inertia = (1.0, 1.0, 0.002)
    stiffness: Stiffness = (300.0, 300.0, 1.0)
    damping: Damping = (10.0, 10.0, 0.02)
    grip_stiffness: Stiffness = (2000.0, 2000.0, 5.0)
    grip_damping: Damping = (20.0, 20.0, 0.05)
    target: tuple[tuple[float, float, float, float], ...]


@dataclass(frozen=True, kw_only=True)
class SpringHand:
    """A massless hand: spring and damper (N/m, N/m, N.m/rad; N.s/m, ...) to a target path,
    rows (t s, x m, y m, theta rad), linear, held after."""

    type: Literal["spring"] = "spring"
    stiffness: Stiffness
    damping: Damping | None = None
    target: tuple[tuple[float, float, float, float], ...] = ((0.0, 0.0, 0.0, 0.0),)


Hand = ConstantHand | ProfileHand | ArmHand | SpringHand
