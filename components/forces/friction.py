"""Coulomb friction on single joint coordinates (dry_friction.py), with the deflection z as a state:

    Q = -f e/d,   tau = d/v_f

f is the friction, d the deflection at which a joint that sticks begins to slide, and v_f the speed
at which it slides without any.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.forces import dry_friction
from hapticlink.components.specs.linkage import Joint, Linkage

if TYPE_CHECKING:
    from hapticlink.components.linkage.model import LinkageModel

_UNITS = {"revolute": ("N.m", "rad", "rad/s"), "prismatic": ("N", "m", "m/s")}


def rubbing(linkage: Linkage) -> list[Joint]:
    """The joints with friction. Raises ValueError for friction on a free joint, which has three
    coordinates."""
    found = [j for j in linkage.joint if j.friction is not None]
    for j in found:
        if j.type not in _UNITS:
            raise ValueError(f"joint `{j.name}`: friction acts on one coordinate, and it has 3")
    return found


def parameters(linkage: Linkage) -> list[Variable]:
    """The parameters of joints with friction, those that are given (friction_scale.py)."""
    found = []
    for j in rubbing(linkage):
        given = {
            "friction": (j.friction, "friction"),
            "friction_deflection": (j.friction_deflection, "deflection at which it slides"),
            "friction_speed": (j.friction_speed, "speed at which it slides"),
        }
        for (name, (value, text)), unit in zip(given.items(), _UNITS[j.type], strict=True):
            if value is not None:
                found.append(Variable(f"{j.name}.{name}", (), unit, value, f"{text} of {j.name}"))
    return found


def states(linkage: Linkage) -> list[Variable]:
    """The deflections of the joints with friction, none without."""
    units = tuple(_UNITS[j.type][1] for j in rubbing(linkage))
    return [Variable("deflection", (len(units),), units)] if units else []


class Joints:
    """Rates v, deflections z and d, friction f and tau of the joints with friction, each k x 1; NaN
    for a linkage that is not `resolved` (friction_scale.py), whose friction is not evaluated."""

    def __init__(self, model: LinkageModel) -> None:
        joints, p = rubbing(model.linkage), model.p
        self.coordinates = [model.coordinate(j.name) for j in joints]
        self.v, self.z = model.qd[self.coordinates], model.deflection
        self.f, self.d, self.v_f = (
            ca.vertcat(*(p.get(f"{j.name}.{name}", ca.SX.nan()) for j in joints))
            for name in ("friction", "friction_deflection", "friction_speed")
        )
        self.tau = self.d / self.v_f


def energy(model: LinkageModel) -> ca.SX | None:
    if not rubbing(model.linkage):
        return None
    at = Joints(model)
    return 0.5 * ca.dot(at.f / at.d, at.z**2)


def efforts(model: LinkageModel) -> ca.SX | None:
    if not rubbing(model.linkage):
        return None
    at, Q = Joints(model), ca.SX(model.q.numel(), 1)
    Q[at.coordinates] = -at.f * dry_friction.held(at.z, at.v, at.d, at.tau) / at.d
    return Q


def bounded(model: LinkageModel, z: ca.SX) -> ca.SX:
    """z within +-d, where it always is unless a step is too long for tau."""
    d = Joints(model).d
    return ca.fmin(ca.fmax(z, -d), d)


def deflection_rates(model: LinkageModel) -> ca.SX:
    """z' of the joints with friction, k x 1; none without."""
    if not rubbing(model.linkage):
        return ca.SX(0, 1)
    at = Joints(model)
    return dry_friction.deflection_rate(at.z, at.v, at.d, at.tau)
