"""Springs and viscous friction on single joint coordinates (joint_coordinates.py):

Q = (dc/dq)' (-k (c - c_rest) - b c')
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.linkage.joint_coordinates import JointCoordinate, joints_with
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Linkage

KEYS = ("stiffness", "rest", "damping")


def parameters(linkage: Linkage) -> list[Variable]:
    """The parameters of these terms. Raises ValueError for a term on a free joint, which has three
    coordinates."""
    variables = []
    for j in joints_with(linkage, *KEYS):
        units = (f"{j.effort_unit}/{j.unit}", j.unit, f"{j.effort_unit}.s/{j.unit}")
        for unit, key in zip(units, KEYS, strict=True):
            if (value := getattr(j.joint, key)) is not None:
                variables.append(Variable(f"{j.name}.{key}", (), unit, value, f"{key} of {j.name}"))
    return variables


def energy(model: LinkageModel) -> ca.SX | None:
    stored = [
        0.5 * model.p[f"{j.name}.stiffness"] * _deflection(model, j) ** 2
        for j in joints_with(model.linkage, "stiffness")
    ]
    return sum(stored[1:], start=stored[0]) if stored else None


def _deflection(model: LinkageModel, joint: JointCoordinate) -> ca.SX:
    c = joint.value(model)
    return c - model.p[f"{joint.name}.rest"] if f"{joint.name}.rest" in model.p else c


def efforts(model: LinkageModel) -> ca.SX | None:
    joints = joints_with(model.linkage, "stiffness", "damping")
    Q = ca.SX(model.q.numel(), 1)
    for j in joints:
        c, effort = j.value(model), ca.SX(0)
        if j.joint.stiffness is not None:
            effort -= model.p[f"{j.name}.stiffness"] * _deflection(model, j)
        if j.joint.damping is not None:
            effort -= model.p[f"{j.name}.damping"] * model.rate(c)
        Q += ca.jacobian(c, model.q).T * effort
    return Q if joints else None
