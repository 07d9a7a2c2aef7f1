"""Variables that blocks of the device share: parameters by their names in [device], and what the
observer puts out."""

from __future__ import annotations

from hapticlink.components.component import Variability, Variable
from hapticlink.components.port_space import PLANE
from hapticlink.components.specs.device import Device

Rows = tuple[tuple[str, str, str], ...]
"""Name, unit and meaning."""

X = Variable("x", *PLANE.pose, description="measured pose of the handle")
V = Variable("v", *PLANE.twist, description="measured velocity of the handle", derivative_of="x")
F_HAND_OBSERVED = Variable(
    "F_hand_observed", *PLANE.wrench, description="observed wrench of the hand"
)
M = Variable("M", *PLANE.inertia, 0.0, "inertia of the device at the handle", kind="semidefinite")
C = Variable("c", *PLANE.wrench, description="C_d v, Coriolis and centrifugal terms at the handle")

X_START = Variable("x_start", *PLANE.pose, 0.0, "pose of the handle at the start", "fixed")
GEOMETRY: Rows = (
    ("proximal_length", "m", "length of the link next to each motor"),
    ("distal_length", "m", "length of the link between elbow and crank end"),
    ("crank", "m", "length of the crank between the two planes"),
    ("base_x", "m", "x midway between the base joints"),
    ("base_half_width", "m", "half the distance between the base joints of a plane"),
    ("base_y_a", "m", "y of the base joints of plane A, below the workspace"),
    ("base_y_b", "m", "y of the base joints of plane B, above the workspace"),
)
INERTIA: Rows = (
    ("rotor_inertia", "kg.m2", "inertia of each motor's rotor"),
    ("proximal_mass", "kg", "mass of each proximal link"),
    ("proximal_center", "m", "its centre of mass from the base joint"),
    ("proximal_inertia", "kg.m2", "its inertia about the centre of mass"),
    ("distal_mass", "kg", "mass of each distal link"),
    ("distal_center", "m", "its centre of mass from the elbow"),
    ("distal_inertia", "kg.m2", "its inertia about the centre of mass"),
    ("handle_mass", "kg", "mass of handle and crank"),
    ("handle_inertia", "kg.m2", "inertia of handle and crank"),
)
FRICTION: Rows = (
    ("motor_damping", "N.m.s/rad", "viscous damping about each motor's axis"),
    ("motor_friction", "N.m", "dry friction about each motor's axis"),
)
TORQUE_LIMIT: Rows = (("torque_limit", "N.m", "largest torque of a motor"),)
STOPS: Rows = (
    ("reach_limit", "1", "fraction of an arm's length at which its stop begins"),
    ("stop_stiffness", "N/m", "stiffness of the stops"),
    ("stop_damping", "N.s/m", "damping of the stops"),
)
ENCODERS: Rows = (("encoder_resolution", "rad", "angle of one encoder count"),)


def variables(device: Device, rows: Rows, variability: Variability) -> list[Variable]:
    """The parameters of some rows, which start at the values of a device."""
    return [
        Variable(name, (), unit, getattr(device, name), text, variability)
        for name, unit, text in rows
    ]
