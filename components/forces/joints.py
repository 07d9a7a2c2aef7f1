"""Springs and viscous friction on single joint coordinates: Q = -k (q - q_rest) - b qd."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.specs.linkage import Linkage

if TYPE_CHECKING:
    from hapticlink.components.linkage.model import LinkageModel

_UNITS = {
    "revolute": ("N.m/rad", "rad", "N.m.s/rad"),
    "prismatic": ("N/m", "m", "N.s/m"),
}


def parameters(linkage: Linkage) -> list[Variable]:
    """The parameters of these terms. Raises ValueError for a term on a free joint, which has three
    coordinates."""
    found = []
    for j in linkage.joint:
        fields = ("stiffness", "rest", "damping")
        given = {f: getattr(j, f) for f in fields if getattr(j, f) is not None}
        if given and j.type not in _UNITS:
            raise ValueError(
                f"joint `{j.name}`: {', '.join(given)} act on one coordinate and a {j.type} joint "
                "has three; use a spring between points"
            )
        for unit, field in zip(_UNITS.get(j.type, ()), fields, strict=False):
            if field in given:
                text = f"{field} of {j.name}"
                found.append(Variable(f"{j.name}.{field}", (), unit, given[field], text))
    return found


def energy(model: LinkageModel) -> ca.SX | None:
    stored = [
        0.5 * model.p[f"{j.name}.stiffness"] * _deflection(model, j.name) ** 2
        for j in model.linkage.joint
        if j.stiffness is not None
    ]
    return sum(stored[1:], start=stored[0]) if stored else None


def _deflection(model: LinkageModel, joint: str) -> ca.SX:
    q = model.q[model.coordinate(joint)]
    return q - model.p[f"{joint}.rest"] if f"{joint}.rest" in model.p else q


def efforts(model: LinkageModel) -> ca.SX | None:
    Q, any_term = ca.SX(model.q.numel(), 1), False
    for j in model.linkage.joint:
        k, p = model.coordinate(j.name), model.p
        if j.stiffness is not None:
            Q[k] -= p[f"{j.name}.stiffness"] * _deflection(model, j.name)
            any_term = True
        if j.damping is not None:
            Q[k] -= p[f"{j.name}.damping"] * model.qd[k]
            any_term = True
    return Q if any_term else None
