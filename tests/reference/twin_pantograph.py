"""Twin pantograph (report, section 1.2 and figure 4.2): kinematics and dynamics in closed form.

Two five-bars in parallel planes, A and B, hold the ends of a crank at p -+ (crank/2)
(cos theta, sin theta). Each five-bar is two arms (proximal and distal link) from a base
joint to its crank end, plane A reaching toward +y and plane B toward -y, elbows outward:
arms 1 to 4 are A left, A right, B left, B right. Every angle is an explicit function of the pose
(x m, y m, theta rad), so rates and dynamics follow by differentiation; theta is not wrapped.

It is the reference for the device's model, which knows dyads and no pantograph. `p` maps the names
of NUMBERS to symbols or numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import casadi as ca

Parameters = Mapping[str, ca.SX]
NUMBERS = {
    "proximal_length": 0.16,
    "distal_length": 0.20,
    "crank": 0.08,
    "base_x": -0.005,
    "base_half_width": 0.03,
    "base_y_a": -0.20,
    "base_y_b": 0.20,
    "rotor_inertia": 1.4e-5,
    "proximal_mass": 0.05,
    "proximal_center": 0.07,
    "proximal_inertia": 1.07e-4,
    "distal_mass": 0.035,
    "distal_center": 0.10,
    "distal_inertia": 1.17e-4,
    "handle_mass": 0.12,
    "handle_inertia": 8e-5,
    "torque_limit": 0.5,
    "encoder_resolution": 0.0015707963267948966,
    "reach_limit": 0.95,
    "stop_stiffness": 5000.0,
    "stop_damping": 20.0,
}
"""Those of the shipped device `twin`."""


class Arm(NamedTuple):
    """One arm at a pose: angles (rad) of both links in the world, points (m), and the offset of
    its crank end from the handle (m)."""

    proximal: ca.SX
    distal: ca.SX
    proximal_direction: ca.SX
    base: ca.SX
    reach: ca.SX
    offset: ca.SX


def arms(pose: ca.SX, p: Parameters) -> Iterator[Arm]:
    """Inverse kinematics of the four arms, each a triangle of base, elbow and crank end.

    With reach r and heading phi of the crank end from the base, by the law of cosines

        proximal = phi + s acos((l1^2 + r^2 - l2^2) / (2 l1 r))
        distal   = phi - s acos((l2^2 + r^2 - l1^2) / (2 l2 r))

    s = +-1 selects the branch with the elbow outward. phi is measured from +y in plane A and -y in
    plane B; no arm turns by pi from there, so no angle jumps inside the workspace. The angles are
    NaN where r is outside [|l1 - l2|, l1 + l2].
    """
    l1, l2 = p["proximal_length"], p["distal_length"]
    half_crank = p["crank"] / 2 * ca.vertcat(ca.cos(pose[2]), ca.sin(pose[2]))
    planes = ((p["base_y_a"], -1, 1), (p["base_y_b"], 1, -1))
    for base_y, crank_end, toward in planes:
        for side in (-1, 1):
            base = ca.vertcat(p["base_x"] + side * p["base_half_width"], base_y)
            offset = crank_end * half_crank
            d = pose[:2] + offset - base
            r = ca.norm_2(d)
            phi = toward * ca.pi / 2 + ca.atan2(-toward * d[0], toward * d[1])
            s = -toward * side
            proximal = phi + s * ca.acos((l1**2 + r**2 - l2**2) / (2 * l1 * r))
            distal = phi - s * ca.acos((l2**2 + r**2 - l1**2) / (2 * l2 * r))
            direction = ca.vertcat(ca.cos(proximal), ca.sin(proximal))
            yield Arm(proximal, distal, direction, base, r, offset)


def base_angles(pose: ca.SX, p: Parameters) -> ca.SX:
    """q(pose), the four base angles (rad) at the motors and encoders, shape (4,)."""
    return ca.vertcat(*(arm.proximal for arm in arms(pose, p)))


def _across(r: ca.SX) -> ca.SX:
    return ca.vertcat(-r[1], r[0])


def _angle_rates(arm: Arm, p: Parameters) -> tuple[ca.SX, ca.SX]:
    """Jacobians of the proximal and the distal angle with respect to the pose, both (1, 3).

    With unit vectors u along and n across the links and e the crank end, the derivative of
    base + l1 u1 + l2 u2 = e(pose), projected on u2 and u1, gives

        proximal' = u2 . e' / (l1 u2 . n1),   distal' = -u1 . e' / (l2 u2 . n1)
    """
    u1, u2 = arm.proximal_direction, ca.vertcat(ca.cos(arm.distal), ca.sin(arm.distal))
    end = ca.horzcat(ca.SX.eye(2), _across(arm.offset))
    s = ca.dot(u2, _across(u1))
    proximal = u2.T @ end / (p["proximal_length"] * s)
    distal = -(u1.T @ end) / (p["distal_length"] * s)
    return proximal, distal


def _rates(arm: Arm, p: Parameters) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Jacobians with respect to the pose, (1, 3), (2, 3) and (1, 3): of the proximal angle, of the
    distal link's centre of mass, and of the distal angle."""
    proximal, distal = _angle_rates(arm, p)
    n1 = _across(arm.proximal_direction)
    n2 = _across(ca.vertcat(ca.cos(arm.distal), ca.sin(arm.distal)))
    centre = p["proximal_length"] * n1 @ proximal + p["distal_center"] * n2 @ distal
    return proximal, centre, distal


def jacobian(pose: ca.SX, p: Parameters) -> ca.SX:
    """J_q = dq/dpose, shape (4, 3): qdot = J_q v, and torques tau give the wrench J_q' tau."""
    return ca.vertcat(*(_angle_rates(arm, p)[0] for arm in arms(pose, p)))


def _all_jacobians(pose: ca.SX, p: Parameters) -> tuple[ca.SX, ca.SX]:
    """(J, m): the Jacobians with respect to the pose of the handle with its crank, of every rotor
    and of every link, stacked, and the mass or moment of inertia that belongs to each row."""
    rows, inertias = [ca.SX.eye(3)], [p["handle_mass"], p["handle_mass"], p["handle_inertia"]]
    about_base = p["proximal_inertia"] + p["proximal_mass"] * p["proximal_center"] ** 2
    for arm in arms(pose, p):
        rows += _rates(arm, p)
        inertias += [p["rotor_inertia"] + about_base]
        inertias += [p["distal_mass"], p["distal_mass"], p["distal_inertia"]]
    return ca.vertcat(*rows), ca.vertcat(*inertias)


def dynamics(pose: ca.SX, v: ca.SX, p: Parameters) -> tuple[ca.SX, ca.SX]:
    """M_d and C_d of (4.5), both (3, 3), M_d vdot + C_d v = wrench.

    With J the stacked Jacobians of all bodies and m the diagonal matrix of their inertias,

        M_d = J' m J,   C_d = J' m Jdot,

    so that dM_d/dt - 2 C_d is skew.
    """
    symbols = ca.SX.sym("pose", 3)
    J, m = _all_jacobians(symbols, p)
    J_dot = ca.reshape(ca.jtimes(ca.vec(ca.densify(J)), symbols, v), J.shape)
    weighted = J.T @ ca.diag(m)
    M, C = ca.substitute([weighted @ J, weighted @ J_dot], [symbols], [pose])
    return M, C


def motion(pose: ca.SX, v: ca.SX, p: Parameters) -> tuple[ca.SX, ca.SX]:
    """M_d and the vector C_d v = J' m (Jdot v) of `dynamics`, with fewer operations than the matrix
    C_d."""
    symbols = ca.SX.sym("pose", 3)
    J, m = _all_jacobians(symbols, p)
    bias = ca.jtimes(J @ v, symbols, v)
    M, c = ca.substitute([J.T @ ca.diag(m) @ J, J.T @ (m * bias)], [symbols], [pose])
    return M, c


def margins(pose: ca.SX, p: Parameters) -> ca.SX:
    """Distances (m) of the four crank ends to the limits of their arms, shape (8,).

    The limits are (1 - reach_limit)(l1 + l2) before the two singular poses of an arm, stretched
    (l1 + l2) and folded (|l1 - l2|). A negative margin lies outside the workspace.
    """
    l1, l2 = p["proximal_length"], p["distal_length"]
    reach = ca.vertcat(*(arm.reach for arm in arms(pose, p)))
    longest = p["reach_limit"] * (l1 + l2)
    shortest = ca.fabs(l1 - l2) + (1 - p["reach_limit"]) * (l1 + l2)
    return ca.vertcat(longest - reach, reach - shortest)


def stop_wrench(pose: ca.SX, v: ca.SX, p: Parameters) -> ca.SX:
    """Wrench (N, N, N.m) of the stops: a unilateral spring and damper for each negative margin m,
    with the force max(0, -K m - B mdot) in the direction in which m grows.
    """
    symbols = ca.SX.sym("pose", 3)
    gap = margins(symbols, p)
    gap, slope = ca.substitute([gap, ca.jacobian(gap, symbols)], [symbols], [pose])
    push = -p["stop_stiffness"] * gap - p["stop_damping"] * (slope @ v)
    return slope.T @ ca.if_else(gap < 0, ca.fmax(0, push), 0)


def motor_torques(wrench: ca.SX, pose: ca.SX, p: Parameters) -> ca.SX:
    """Torques (N.m, four) of least norm that give the wrench, tau = J_q (J_q' J_q)^-1 wrench.

    If one would exceed torque_limit all four are scaled by one factor, which keeps the direction.
    """
    J = jacobian(pose, p)
    tau = J @ ca.solve(J.T @ J, wrench)
    limit = p["torque_limit"]
    return tau * (limit / ca.fmax(limit, ca.mmax(ca.fabs(tau))))
