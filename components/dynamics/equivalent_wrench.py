"""F_env (2.18): the wrench at a point that has the same effect there as all contacts and others.

    Lambda^-1 F_env = J D^-1 (I - W' (W D^-1 W')^-1 W D^-1) sum_i J_i' F_i

of least norm in the scaled metric S = diag(1, 1, L).
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.dynamics.constrained_directions import (
    eigen,
    largest,
    locking_threshold,
    scaling,
)
from hapticlink.components.port_space import PortSpace

# Directions with an eigenvalue below this share of the largest one are left out of F_env, and so
# are those that the loops lock.
RANK = 1e-6


def wrench_output(
    space: PortSpace, prefix: str = "", place: str = "the operational point"
) -> Variable:
    text = f"wrench of contacts, joint limits and others at {place}"
    return Variable(f"{prefix}F_env", *space.wrench, description=text)


def equivalent_wrench(
    space: PortSpace,
    Lambda_inv: ca.SX,
    open_mobility: ca.SX,
    acceleration: ca.SX,
    length_scale: ca.SX,
) -> ca.SX:
    """The wrench F of least scaled norm with Lambda^-1 F = a, F = S (S Lambda^-1 S)^+ S a.
    open_mobility is J D^-1 J' of the linkage with open loops."""
    S = scaling(space, length_scale)
    values, vectors = eigen(S @ Lambda_inv @ S)
    least = locking_threshold(S @ open_mobility @ S)
    mobile = values > ca.fmax(RANK * largest(values), least)
    inverse = ca.if_else(mobile, 1 / ca.if_else(mobile, values, 1), 0)
    return S @ (vectors @ (inverse * (vectors.T @ (S @ acceleration))))
