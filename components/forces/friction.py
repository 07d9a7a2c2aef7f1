"""Coulomb friction that sticks: a slider in series with a spring and a damper.

    e  = clip(z + tau v, -d, d)        v: rate of the sliding surfaces, z: deflection of the spring
    F  = -k e                          |F| <= k d, the friction
    z' = (e - z)/tau

Where |z + tau v| < d the slider sticks: z' = v, and F = -k z - k tau v is an elastic force that
holds its place for any time; nothing creeps. Otherwise it slides: |F| = k d at any speed, and z
follows to +-d within tau. It is not stiffer at high speeds, and it dissipates: -F v >= (k z^2/2)'.

Kikuuwe, Takesue, Sano, Mochiyama, Fujimoto, IEEE Trans. Robotics 22 (2006), 1176; without drift
before sliding as Dupont, Hayward, Armstrong, Altpeter, IEEE Trans. Automatic Control 47 (2002),
787, require.

On the coordinate c of a joint, with the deflection z as a state,

    Q = -(dc/dq)' f e/d,   tau = d/v_f

f is the friction, d the deflection at which a joint that sticks begins to slide, and v_f the speed
at which it slides without any.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.linkage.joint_coordinates import JointCoordinate, joints_with
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Linkage

LAG = 4  # default of tau, in integration steps: of its modes in a step, none is faster than 1/4
KEYS = ("friction", "friction_deflection", "friction_speed")


def friction_effort(z: ca.SX, v: ca.SX, d: ca.SX, tau: ca.SX | float) -> ca.SX:
    """e, in the unit of the deflection z."""
    return ca.fmin(ca.fmax(z + tau * v, -d), d)


def deflection_rate(z: ca.SX, v: ca.SX, d: ca.SX, tau: ca.SX | float) -> ca.SX:
    """z'."""
    return (friction_effort(z, v, d, tau) - z) / tau


def rubbing(linkage: Linkage) -> list[JointCoordinate]:
    """The joints and cut joints with friction. Raises ValueError for friction on a free joint,
    which has three coordinates."""
    return joints_with(linkage, "friction")


def parameters(linkage: Linkage) -> list[Variable]:
    """The parameters of joints with friction that are given; friction_scale.py defines others."""
    rows = []
    texts = ("friction", "deflection at which it slides", "speed at which it slides")
    for j in rubbing(linkage):
        units = (j.effort_unit, j.unit, f"{j.unit}/s")
        for key, unit, text in zip(KEYS, units, texts, strict=True):
            if (value := getattr(j.joint, key)) is not None:
                rows.append(Variable(f"{j.name}.{key}", (), unit, value, f"{text} of {j.name}"))
    return rows


def states(linkage: Linkage) -> list[Variable]:
    """The deflections of the joints with friction, none without."""
    units = tuple(j.unit for j in rubbing(linkage))
    return [Variable("deflection", (len(units),), units)] if units else []


class Joints:
    """Rates v, deflections z and d, friction f and tau of the joints with friction, each k x 1, and
    the Jacobian of their coordinates (k x n); NaN without the defaults of friction_scale.py, where
    friction is not evaluated."""

    def __init__(self, model: LinkageModel) -> None:
        joints, p = rubbing(model.linkage), model.p
        c = ca.vertcat(*(j.value(model) for j in joints))
        self.jacobian = ca.jacobian(c, model.q)
        self.v, self.z = model.rate(c), model.deflection
        self.f, self.d, self.v_f = (
            ca.vertcat(*(p.get(f"{j.name}.{key}", ca.SX.nan()) for j in joints)) for key in KEYS
        )
        self.tau = self.d / self.v_f


def energy(model: LinkageModel) -> ca.SX | None:
    if not rubbing(model.linkage):
        return None
    j = Joints(model)
    return 0.5 * ca.dot(j.f / j.d, j.z**2)


def efforts(model: LinkageModel) -> ca.SX | None:
    if not rubbing(model.linkage):
        return None
    j = Joints(model)
    return -j.jacobian.T @ (j.f * friction_effort(j.z, j.v, j.d, j.tau) / j.d)


def clip_deflection(model: LinkageModel, z: ca.SX) -> ca.SX:
    """z within +-d, where it always is unless a step is too long for tau."""
    d = Joints(model).d
    return ca.fmin(ca.fmax(z, -d), d)


def deflection_rates(model: LinkageModel) -> ca.SX:
    """z' of the joints with friction, k x 1; none without."""
    if not rubbing(model.linkage):
        return ca.SX(0, 1)
    j = Joints(model)
    return deflection_rate(j.z, j.v, j.d, j.tau)
