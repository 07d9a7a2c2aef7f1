"""Further operational points: each has an input for a hand's wrench, and its pose, velocity and
mobility as outputs.

    x = x_k(q),   v = J_k qd,   Lambda_k^-1 = J_k D^-1 (J_k' - W' (W D^-1 W')^-1 W D^-1 J_k')

Their wrenches act on the linkage in addition to that at the operational point: Q += J_k' F_k.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import MOBILITY, POSE, TWIST, WRENCH, Signals, Variable
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.ports import Power
from hapticlink.components.specs.linkage import Linkage


def inputs(linkage: Linkage) -> list[Variable]:
    return [
        Variable(
            f"{point.name}.F_hand",
            (3,),
            WRENCH,
            description=f"wrench at {point.name}",
            power=Power(f"{point.name}.x"),
        )
        for point in linkage.point
    ]


def outputs(linkage: Linkage, mobility: bool) -> list[Variable]:
    found = []
    for point in linkage.point:
        x, v, mobile = (f"{point.name}.{port}" for port in ("x", "v", "Lambda_inv"))
        found.append(Variable(x, (3,), POSE, description=f"pose of {point.name}"))
        text = f"velocity of {point.name}"
        found.append(Variable(v, (3,), TWIST, description=text, derivative_of=x))
        if mobility:
            text = f"mobility at {point.name}"
            found.append(Variable(mobile, (3, 3), MOBILITY, description=text, kind="semidefinite"))
    return found


def efforts(model: LinkageModel, u: Signals) -> ca.SX:
    """Sum of J_k' F_k, n x 1."""
    Q = ca.SX(model.q.numel(), 1)
    for point in model.linkage.point:
        x = model.pose(point.body, f"{point.name}.at")
        Q += ca.jtimes(x, model.q, u[f"{point.name}.F_hand"], True)
    return Q


def values(space: OperationalSpace, mobility: bool) -> dict[str, ca.SX]:
    found, model = {}, space.model
    for point in model.linkage.point:
        x = model.pose(point.body, f"{point.name}.at")
        found[f"{point.name}.x"] = x
        found[f"{point.name}.v"] = model.rate(x)
        if mobility:
            found[f"{point.name}.Lambda_inv"] = space.mobility(ca.jacobian(x, model.q))
    return found
