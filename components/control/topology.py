"""Topology (joint-constraint) controller: a stiff PD controller along the constrained directions.

Report, section 4.2.4 and (B.14). S = diag(1, 1, L) makes lengths and angles comparable; P_c is the
orthogonal projector on null(S Lambda^-1 S), the constrained directions.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.dynamics.constrained_directions import scaling
from hapticlink.components.dynamics.rendered_directions import WHOLE, RenderedDirections
from hapticlink.components.port_space import PortSpace

LAW = r"$F_T = S (P_c M_s^{-1} P_c)^+ S$" "\n" r"$(k_j e + b_j \dot{e}),\ e = x_S - x_D$"
"""Of the schematic."""


def constraint_wrench(
    space: PortSpace,
    pull: ca.SX,
    M: ca.SX,
    P_c: ca.SX,
    length_scale: ca.SX,
    rendered: RenderedDirections = WHOLE,
) -> ca.SX:
    """F_T = S (P_c M_s^-1 P_c)^+ S pull, with M_s = S^-1 M_d S^-1 (N, N, N.m).

    pull = k_j e + b_j edot (m/s2, m/s2, rad/s2) is the acceleration of the device along the
    constrained directions: k_j and b_j are per kilogram of the device's inertia along them. The map
    is symmetric and positive semidefinite. For exact null directions it does no work on free motion
    and does not depend on L; directions below `rank_tolerance` that still move are counted, too,
    and there it does both (docs/theory.md has the size).
    The pseudoinverse takes bounded work for any rank, since for a projector P

        (P A P)^+ = (P A P + I - P)^-1 P.

    All of it is in the directions that are `rendered`.
    """
    S, P = (rendered.pick_matrix(each) for each in (scaling(space, length_scale), P_c))
    mobility = S @ ca.inv(rendered.pick_matrix(M)) @ S
    regular = P @ mobility @ P + ca.SX.eye(rendered.size) - P
    return rendered.put(S @ ca.solve(regular, P @ S @ rendered.pick(pull)))
