"""Generalised coordinate partitioning: Wehage and Haug, J. Mech. Design 104 (1982), 247; an
alternative to multipliers in section B.2.

q = (z, y) with a regular block W_y of W at the start pose, by elimination with full pivoting:

    y <- y - W_y^-1 h(z, y)   repeated,   yd = -W_y^-1 W_z zd,   zdd = rows of qdd in (B.6)

Only (z, zd) and further states s are integrated, so that closures need no stabilisation; zdd is
that of the formulation by multipliers. Newton's method starts at `near`, the pose before the step,
with an error of about h |yd| that each of a fixed number of iterations squares. Where W_y becomes
singular the formulation fails, even if the linkage itself is not singular there.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from hapticlink.components import integrators
from hapticlink.components.component import Signals
from hapticlink.components.dynamics.assembly import assemble
from hapticlink.components.integrators.base import Integrator
from hapticlink.components.linkage.branch import dependent_coordinates
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Mechanism

REPEATS = 4


def require_fitting(mechanism: Mechanism, held: bool) -> None:
    """Raises ValueError for settings that do not fit independent coordinates; held: the matrices
    are inputs (local_model)."""
    if mechanism.formulation == "multipliers":
        return
    name = f'`mechanism.formulation` = "{mechanism.formulation}"'
    if mechanism.stabilization == "baumgarte":
        raise ValueError(
            f"{name} satisfies the closures exactly and has no Baumgarte terms; "
            "leave `mechanism.stabilization` out, or take multipliers"
        )
    if held:
        raise ValueError(f"{name} needs the matrices at its own pose: take `local_model` = false")


class Partitioning:
    """The formulation of a model, partitioned at its start pose.

    ode: function (x, u, p, t) -> (qd, qdd, s') by multipliers, with x = (q, qd, s). complete:
    function ((z, zd, s), near, p) -> x.
    """

    def __init__(self, model: LinkageModel, parameters: Signals, ode: ca.Function) -> None:
        n = model.q.numel()
        start = _start_pose(model, parameters)
        rows, dependent = dependent_coordinates(model, start, unseen_first=False)
        free = [i for i in range(n) if i not in dependent]
        p, k = parameters.vector, len(free)
        closures = ca.Function("closures", [model.q, p], [model.h[rows], model.W[rows, :]])
        self._integrated = [*free, *(n + i for i in free), *range(2 * n, ode.numel_out(0))]
        self._positions = range(k)
        state, near = ca.SX.sym("z", len(self._integrated)), ca.SX.sym("near", n)
        q = ca.SX(near)
        q[free] = state[:k]
        for _ in range(REPEATS):
            h, W = closures(q, p)
            q[dependent] = q[dependent] - ca.solve(W[:, dependent], h)
        W, qd = closures(q, p)[1], ca.SX(n, 1)
        qd[free] = state[k : 2 * k]
        qd[dependent] = -ca.solve(W[:, dependent], W[:, free] @ qd[free])
        x = ca.vertcat(q, qd, state[2 * k :])
        self.complete = ca.Function("complete", [state, near, p], [x], {"cse": True})
        u, t = ca.SX.sym("u", ode.numel_in(1)), ca.SX.sym("t")
        rates = ode(self.complete(state, near, p), u, p, t)[self._integrated]
        self._ode = ca.Function("ode", [state, ca.vertcat(u, near), p, t], [rates], {"cse": True})

    def step(
        self, integrator: Integrator, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX, h: ca.SX
    ) -> ca.SX:
        """(q, qd, s) after h from x = (q, qd, s)."""
        near = x[: self.complete.numel_in(1)]
        z, inputs = x[self._integrated], ca.vertcat(u, near)
        z = integrators.step(integrator, self._ode, z, inputs, p, t, h, self._positions)
        return self.complete(z, near, p)


def _start_pose(model: LinkageModel, parameters: Signals) -> np.ndarray:
    """The assembled start pose and the default parameters, (q, p)."""
    p = np.array([s for v in parameters.variables for s in v.starts])
    q0, _ = assemble(
        LinkageModel(model.linkage, parameters, parameters["q_start"], parameters["qd_start"])
    )
    start = ca.Function("start", [parameters.vector], [q0])(p)
    return np.concatenate([np.array(start).ravel(), p])
