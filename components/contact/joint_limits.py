"""Joint limits: one-sided spring-dampers (one_sided_spring.py) at the ends of a coordinate's range.

    g = c - c_lower,  g' = c'    and    g = c_upper - c,  g' = -c'
    Q = (dc/dq)' (F_lower - F_upper)

c is the coordinate of a joint or a cut joint (joint_coordinates.py). A restitution e, the rate
after an impact by that before it, gives the damping

    b = 2 z sqrt(k m),   1/m = (dc/dq) D^-1 (1 - W' (W D^-1 W')^-1 W D^-1) (dc/dq)'
    e = exp(-2 z acos(z)/sqrt(1 - z^2))

since a mass m on a spring-damper that lets go when its force is 0 has that restitution (Schwager
and Poeschel, Granular Matter 9, 2007, 465). m is the inertia of the coordinate, with the loops
closed, at the pose at hand. Other forces and the change of m during an impact add to it: by little
where the limit is stiff.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.contact.one_sided_spring import OneSidedForces, Unilateral
from hapticlink.components.dynamics.constrained_directions import LOCKED
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.linkage.joint_coordinates import JointCoordinate, joints_with
from hapticlink.components.specs.linkage import Limits, Linkage


def damping_ratio(restitution: float) -> float:
    """z with e(z) = restitution, from 0.01 to 1."""
    from scipy.optimize import brentq  # slow to load

    def excess(z: float) -> float:
        if z == 1:
            return -2 - math.log(restitution)
        ratio = math.acos(z) if z < 1 else math.acosh(z)
        return -2 * z * ratio / math.sqrt(abs(1 - z**2)) - math.log(restitution)

    return 0.0 if restitution == 1 else float(brentq(excess, 0, 10, xtol=1e-15, rtol=1e-15))


def parameters(linkage: Linkage) -> list[Variable]:
    variables = []
    for joint in joints_with(linkage, "limits"):
        limits, effort = _limits(joint), joint.effort_unit
        stiffness, damping = f"{effort}/{joint.unit}", f"{effort}.s/{joint.unit}"
        given = {
            "lower": (joint.unit, limits.lower, "lower end of the range"),
            "upper": (joint.unit, limits.upper, "upper end of the range"),
            "limit_stiffness": (stiffness, limits.stiffness, "stiffness of the ends"),
            "limit_damping": (damping, limits.damping, "damping of the ends"),
        }
        if limits.restitution is not None:
            ratio, text = damping_ratio(limits.restitution), f"for e = {limits.restitution!r}"
            given["limit_damping_ratio"] = ("1", ratio, f"damping ratio {text} at the ends")
        for name, (unit, value, text) in given.items():
            if value is not None:
                text = f"{text} of {joint.name}"
                variables.append(Variable(f"{joint.name}.{name}", (), unit, value, text))
    return variables


class JointLimits(OneSidedForces):
    """The forces of all joint limits of a linkage."""

    def __init__(self, space: OperationalSpace) -> None:
        model = space.model
        self._n, p = model.q.numel(), model.p
        joints = joints_with(model.linkage, "limits")
        coordinates = [joint.value(model) for joint in joints]
        inertias = _inertias(space, joints, coordinates)
        self.sides, self._ways = [], []
        for joint, c in zip(joints, coordinates, strict=True):
            k, rate = p[f"{joint.name}.limit_stiffness"], model.rate(c)
            b = ca.SX(0)
            if _limits(joint).restitution is not None:
                ratio = p[f"{joint.name}.limit_damping_ratio"]
                b = 2 * ratio * ca.sqrt(k * next(inertias))
            elif _limits(joint).damping is not None:
                b = p[f"{joint.name}.limit_damping"]
            for end, sign in (("lower", 1), ("upper", -1)):
                if (limit := p.get(f"{joint.name}.{end}")) is not None:
                    self.sides.append(Unilateral(sign * (c - limit), sign * rate, k, b))
                    self._ways.append(sign * ca.jacobian(c, model.q).T)

    def efforts(self, laws: ca.SX | None = None) -> ca.SX:
        Q = ca.SX(self._n, 1)
        for i, (side, way) in enumerate(zip(self.sides, self._ways, strict=True)):
            Q += way * side.force(None if laws is None else laws[i])
        return Q


def _limits(joint: JointCoordinate) -> Limits:
    assert joint.joint.limits is not None
    return joint.joint.limits


def _inertias(
    space: OperationalSpace, joints: list[JointCoordinate], coordinates: list[ca.SX]
) -> Iterator[ca.SX]:
    """The inertia m of each coordinate whose limits have a restitution, with the loops closed; that
    of one which the loops lock is bounded by its inertia with open loops."""
    both = zip(joints, coordinates, strict=True)
    given = [c for joint, c in both if _limits(joint).restitution is not None]
    if not given:
        return
    J = ca.jacobian(ca.vertcat(*given), space.model.q)
    closed, opened = space.mobility(J), space.open_mobility(J)
    for i in range(len(given)):
        yield 1 / ca.fmax(closed[i, i], LOCKED * opened[i, i])
