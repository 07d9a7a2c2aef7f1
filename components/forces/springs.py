"""Springs and dampers between two points: force k (d - d_0) + b d' along their distance d.

V = 1/2 k (d - d_0)^2. Without a free length, V = 1/2 k d^2 has no singularity where the points
coincide. With one, the direction of the force is undefined there, and the force is zero.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.specs.linkage import Linkage

if TYPE_CHECKING:
    from hapticlink.components.linkage.model import LinkageModel


MET = 1e-200  # m2: below this d^2 the points coincide


def _name(linkage: Linkage, index: int) -> str:
    return linkage.spring[index].name or f"spring{index + 1}"


def parameters(linkage: Linkage) -> list[Variable]:
    variables = []
    for i, s in enumerate(linkage.spring):
        name = _name(linkage, i)
        for k, (body, point) in enumerate(zip(s.bodies, s.at, strict=True)):
            text = f"{name} on {body}"
            at = f"{name}.at{k + 1}"
            variables.append(Variable(at, (len(point),), "m", point, text, "fixed"))
        for field, unit, value in (
            ("stiffness", "N/m", s.stiffness),
            ("damping", "N.s/m", s.damping),
            ("length", "m", s.length),
        ):
            if value is not None:
                variables.append(Variable(f"{name}.{field}", (), unit, value, f"{field} of {name}"))
    return variables


def _span(model: LinkageModel, index: int) -> ca.SX:
    name = _name(model.linkage, index)
    ends = [
        model.at(body, f"{name}.at{k + 1}")
        for k, body in enumerate(model.linkage.spring[index].bodies)
    ]
    return ends[0] - ends[1]


def energy(model: LinkageModel) -> ca.SX | None:
    stored = []
    for i, s in enumerate(model.linkage.spring):
        if s.stiffness is None:
            continue
        name, span = _name(model.linkage, i), _span(model, i)
        squared = ca.dot(span, span)
        if s.length is not None:
            squared = (ca.sqrt(ca.fmax(squared, MET)) - model.p[f"{name}.length"]) ** 2
        stored.append(0.5 * model.p[f"{name}.stiffness"] * squared)
    return sum(stored[1:], start=stored[0]) if stored else None


def efforts(model: LinkageModel) -> ca.SX | None:
    V = energy(model)
    parts = [] if V is None else [-ca.gradient(V, model.q)]
    for i, s in enumerate(model.linkage.spring):
        if s.damping is None:
            continue
        span = _span(model, i)
        rate = model.rate(span)
        if s.length is not None:  # damps along the distance only
            rate = span * ca.dot(span, rate) / ca.fmax(ca.dot(span, span), MET)
        b = model.p[f"{_name(model.linkage, i)}.damping"]
        parts.append(-ca.jacobian(span, model.q).T @ (b * rate))
    return sum(parts[1:], start=parts[0]) if parts else None
