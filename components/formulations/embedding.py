"""Constraint embedding: dependent coordinates as explicit functions of the independent ones.

Each loop's dyad in closed form (dyads.py) gives q(z). With G = dq/dz, by substitution in (2.3),

    q = q(z),   qd = G zd,   G' D G zdd = G' (Q - C qd - D Gdot zd)

and W' lambda vanishes, since W G = 0. The branch is that of the pose before the step; a z for which
the loops cannot close gives NaN.

No shipped scene uses it: it is the family of section B.2 that was found too slow for haptics;
`hapticlink bench mechanism` compares it with the other two.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from hapticlink.components.component import Signals
from hapticlink.components.dynamics.articulated_body import TreeInertia, symmetric
from hapticlink.components.formulations.dyad_search import find_dyads
from hapticlink.components.formulations.dyads import Dyad
from hapticlink.components.linkage.model import LinkageModel


class Embedding:
    """The formulation of a model, with dyads chosen at its start pose (q, p).

    efforts: the function (x, u, p, t) -> (Q - C qd, s'), applied wrenches included, with
    x = (q, qd, s). Raises ValueError for a loop without a dyad.
    """

    def __init__(
        self,
        model: LinkageModel,
        parameters: Signals,
        start: tuple[np.ndarray, np.ndarray],
        efforts: ca.Function,
    ) -> None:
        n, p = model.q.numel(), parameters.vector
        dyads = find_dyads(model, np.concatenate(start))
        set_by_loops = {model.coordinate(j.name) for dyad in dyads for j in dyad.joints}
        self.independent = [i for i in range(n) if i not in set_by_loops]
        k = len(self.independent)
        z, zd, near = ca.SX.sym("z", k), ca.SX.sym("zd", k), ca.SX.sym("near", n)
        further = ca.SX.sym("further", efforts.numel_out(1))
        state = ca.vertcat(z, zd, further)
        q = self._pose(model, parameters, dyads, z, near)
        qd = ca.jtimes(q, z, zd)
        x = ca.vertcat(q, qd, further)
        self.complete = ca.Function("complete", [state, near, p], [x], {"cse": True})
        G, bias = ca.jacobian(q, z), ca.jtimes(qd, z, zd)
        columns = ca.SX.sym("columns", n, k + 1)
        inertia = ca.Function(
            "inertia", [model.q, p, columns], [TreeInertia(model).apply(columns)], {"cse": True}
        )
        D_columns = inertia(q, p, ca.horzcat(G, bias))
        u, t = ca.SX.sym("u", efforts.numel_in(1)), ca.SX.sym("t")
        Q, further_rates = efforts(x, u, p, t)
        left = G.T @ (Q - D_columns[:, k])
        factor = ca.ldl(ca.sparsify(symmetric(G.T @ D_columns[:, :k])), False)
        rates = ca.vertcat(zd, ca.ldl_solve(left, *factor), further_rates)
        self.ode = ca.Function("ode", [state, ca.vertcat(u, near), p, t], [rates], {"cse": True})

    def _pose(
        self, model: LinkageModel, p: Signals, dyads: list[Dyad], z: ca.SX, near: ca.SX
    ) -> ca.SX:
        """q(z), with angles within half a turn of those of `near`."""
        linkage, still = model.linkage, ca.SX(near.numel(), 1)
        before = LinkageModel(linkage, p, near, still)
        q = ca.SX(near)
        q[self.independent] = z
        for dyad in dyads:
            sigma = ca.if_else(dyad.side(before) < 0, -1, 1)
            q = dyad.close(lambda q: LinkageModel(linkage, p, q, still), q, sigma)
        return q
