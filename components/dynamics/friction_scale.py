"""Stiffness and damping of joints that stick (friction.py), as large as a step can integrate.

With A the mobility of a joint at the start pose, with its loops closed but at least a quarter of
that with open loops, since it may be small there (at a dead centre), and N joints with friction f,
by default

    v_f = 4 N f A h,   d = 4 h v_f

for steps of h: all dampers together have a pole at 1/(4 h) or slower, and a joint that sticks has a
damping ratio of sqrt(f A d)/(2 v_f) = 1/2 for N = 1, as it has where only one of both is given and
this is not stiffer. So friction approaches Coulomb's law with h. Given values that an explicit
method cannot integrate at the start pose are refused.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NoReturn

import casadi as ca
import numpy as np

from hapticlink.components.component import Signals
from hapticlink.components.dynamics.assembly import assemble
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.variables import parameters, start_parameters
from hapticlink.components.forces.dry_friction import LAG
from hapticlink.components.forces.friction import rubbing
from hapticlink.components.linkage.joint_coordinates import JointCoordinate
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Linkage, Mechanism

LEAST = 1e-9  # rad/s or m/s, of a default v_f
OPENED = 0.25  # share of the mobility with open loops
STABLE = 2.0  # |pole| h up to which the explicit methods are stable
IMPLICIT = "linearly-implicit"


def resolved(linkage: Linkage, mechanism: Mechanism, step_s: float) -> Linkage:
    """The linkage with the default speeds and deflections of its friction for integration steps of
    step_s (s). Raises ValueError for given ones that are too stiff for the method."""
    rubs = rubbing(linkage)
    if not rubs:
        return linkage
    joints, loops = {j.name: j for j in linkage.joint}, list(linkage.loop)
    for j, (closed, opened) in zip(rubs, _mobilities(linkage, rubs), strict=True):
        if mechanism.integrator != IMPLICIT:
            _require_slow(j, closed, step_s)
        scaled = _scaled(j.joint, max(closed, OPENED * opened), len(rubs), step_s)
        if j.cut is None:
            joints[j.name] = scaled
        else:
            loops[j.cut] = scaled
    return replace(linkage, joint=tuple(joints.values()), loop=tuple(loops))


def _scaled(joint: Any, A: float, N: int, h: float) -> Any:
    """The joint with both its v_f and d; if f is 0, which may be tuned, those for f = 1."""
    d, v_f, pull = joint.friction_deflection, joint.friction_speed, (joint.friction or 1.0) * A
    if v_f is None:
        v_f = max(4 * N * pull * h, LEAST)
        v_f = v_f if d is None else max(min(v_f, d / h), (pull * d) ** 0.5)
    if d is None:
        d = max(LAG * h * v_f, v_f**2 / pull if pull else 0.0)
    return replace(joint, friction_speed=v_f, friction_deflection=d)


def _require_slow(rubbing: JointCoordinate, A: float, h: float) -> None:
    joint, name = rubbing.joint, f"joint `{rubbing.name}`"
    pull, d, v_f = (joint.friction or 0.0) * A, joint.friction_deflection, joint.friction_speed
    if v_f and pull / v_f * h > STABLE:
        _refuse(f"{name}: `friction_speed` = {v_f!r}", pull / v_f, 4 * pull * h, h)
    if d and (pole := max((pull / d) ** 0.5, (v_f or 0.0) / d)) * h > STABLE:
        enough = LAG * h * max(v_f or 0.0, pull * h)
        _refuse(f"{name}: `friction_deflection` = {d!r}", pole, enough, h)


def _refuse(what: str, pole: float, enough: float, h: float) -> NoReturn:
    raise ValueError(
        f"{what} makes a pole at {pole:.3g} 1/s, too fast for steps of {h:.3g} s: leave it out, "
        f"take {enough:.2g} or more, a higher rate, more `mechanism.substeps`, or "
        f"`mechanism.integrator` = {IMPLICIT!r}"
    )


def _mobilities(linkage: Linkage, joints: list[JointCoordinate]) -> list[tuple[float, float]]:
    """Mobilities (1/kg or 1/(kg.m2)) of joints at the start pose, with closed and open loops."""
    p = Signals("p", [*parameters(linkage), *start_parameters(linkage)])
    q0, _ = assemble(LinkageModel(linkage, p, p["q_start"], p["qd_start"]))
    q, qd = ca.SX.sym("q", q0.numel()), ca.SX.sym("qd", q0.numel())
    model = LinkageModel(linkage, p, q, qd)
    J = ca.jacobian(ca.vertcat(*(j.value(model) for j in joints)), q)
    start = ca.Function("start", [p.vector], [q0])
    space = OperationalSpace(model)
    both = [ca.diag(space.mobility(J)), ca.diag(space.open_mobility(J))]
    mobilities = ca.Function("mobilities", [q, p.vector], both)
    values = [value for v in p.variables for value in v.starts]
    closed, opened = (np.array(m).ravel() for m in mobilities(start(values), values))
    return [(max(float(c), 0.0), float(o)) for c, o in zip(closed, opened, strict=True)]
