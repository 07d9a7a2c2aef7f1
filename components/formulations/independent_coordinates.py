"""Motion in independent coordinates z, a part of q: alternatives to multipliers in section B.2.

A formulation computes, from z, zd and a pose `near` on the same branch, the q and qd that close
every loop, and zdd. Only (z, zd) and further states s are integrated, so that closures need no
stabilisation. The independent coordinates are chosen at the start pose: where the dependent ones
become singular the formulation fails, even if the linkage itself is not singular there.
"""

from __future__ import annotations

from typing import Protocol

import casadi as ca
import numpy as np

from hapticlink.components import integrators
from hapticlink.components.component import Signals
from hapticlink.components.dynamics.assembly import assemble
from hapticlink.components.integrators.base import Integrator
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Mechanism


class Formulation(Protocol):
    """independent: indices in q of z (k entries). ode: function ((z, zd, s), (u, near), p, t) ->
    (zd, zdd, s'). complete: function ((z, zd, s), near, p) -> (q, qd, s)."""

    independent: list[int]
    ode: ca.Function
    complete: ca.Function


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


def start_pose(model: LinkageModel, parameters: Signals) -> tuple[np.ndarray, np.ndarray]:
    """The assembled start pose q and the default parameters p."""
    p = np.array([s for v in parameters.variables for s in v.starts])
    q0, _ = assemble(
        LinkageModel(model.linkage, parameters, parameters["q_start"], parameters["qd_start"])
    )
    return np.array(ca.Function("start", [parameters.vector], [q0])(p)).ravel(), p


def step(
    integrator: Integrator,
    formulation: Formulation,
    x: ca.SX,
    u: ca.SX,
    p: ca.SX,
    t: ca.SX,
    h: ca.SX,
) -> ca.SX:
    """(q, qd, s) after h from x = (q, qd, s)."""
    n, k = formulation.complete.numel_in(1), len(formulation.independent)
    near, free = x[:n], formulation.independent
    z = x[[*free, *(n + i for i in free), *range(2 * n, x.numel())]]
    inputs = ca.vertcat(u, near)
    z = integrators.step(integrator, formulation.ode, z, inputs, p, t, h, range(k))
    return formulation.complete(z, near, p)
