"""Start of the deflections z of joints with friction (friction.py): nothing jerks at t = 0.

A joint that moves starts fully deflected, z = d sign(qd). Joints at rest start with
the deflections that keep them at rest, as far as friction can:

    0 = a + A F,   a: their accelerations without friction of their own,   A: their mobility
    z = clip(-F d/f, -d, d)

F is the solution of least norm in the scale of A where the loops leave it open.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.dynamics.closed_loop_solver import Regularised
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.forces.friction import Joints

MU = 1e-12  # relative to the mean of A_ii
MOVING = 1e-6  # of v_f
TINY = 1e-200


def start(space: OperationalSpace, Q: ca.SX, q: ca.SX, qd: ca.SX, t: ca.SX) -> ca.SX:
    """z at (q, qd) and t = 0, k x 1. Q: generalised forces in addition to the linkage's own, in the
    symbols of the model."""
    model = space.model
    joints, k = Joints(model), model.deflection.numel()
    J = joints.jacobian
    resting = ca.fabs(joints.v) < MOVING * joints.v_f
    sliding = ca.if_else(resting, 0, joints.d * ca.sign(joints.v))
    motion = J @ space.motion(Q)[0] + ca.jtimes(joints.v, model.q, model.qd)
    a = ca.substitute(motion, model.deflection, sliding)
    a = ca.if_else(resting, a, 0)
    chosen = ca.diag(resting)
    A = chosen @ space.mobility(J) @ chosen
    shift = ca.if_else(resting, MU * ca.trace(A) / k + TINY, 1)
    F = -Regularised(A, shift).proximal(a)
    deflection = ca.if_else(resting, -F * joints.d / ca.fmax(joints.f, TINY), sliding)
    z = ca.fmin(ca.fmax(deflection, -joints.d), joints.d)
    symbols, values = ca.vertcat(model.q, model.qd, t), ca.densify(ca.vertcat(q, qd, 0))
    return ca.substitute(z, symbols, values)
