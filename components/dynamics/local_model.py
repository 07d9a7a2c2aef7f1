"""The local model of interaction (B.15): D, W, w, J_h held from the graphics rate.

    Dh qdd = sum_i J_i' F_i + J_hh' F_h + Q + Wh' lambda
    Wh qdd = -(wh + 2 alpha beta h' + alpha^2 h)

with a trailing h for values held from the last frame. Coriolis terms are left out, as in the
report. The closures h(q), their rate, applied forces Q and contacts are evaluated by the mechanism
at every step, since otherwise the loop would open between frames.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from hapticlink.components import forces
from hapticlink.components.component import Signals, Variable
from hapticlink.components.dynamics.articulated_body import FLOOR
from hapticlink.components.dynamics.assembly import assemble
from hapticlink.components.dynamics.closed_loop_solver import MatrixInertia
from hapticlink.components.dynamics.light_bodies import added_inertia
from hapticlink.components.dynamics.operational_space import Terms
from hapticlink.components.dynamics.variables import parameters, start_parameters
from hapticlink.components.linkage.model import LinkageModel, count_rows
from hapticlink.components.specs.linkage import Linkage

SYMBOLS = {"D": r"\widehat{D}", "W": r"\widehat{W}", "w": r"\widehat{w}", "J_h": r"\widehat{J}_h"}
"""Of the schematic, for values held from the last frame."""


def ports(linkage: Linkage) -> list[Variable]:
    """The inputs D (n x n), W (m x n), w (m) and J_h (k x n); their start values are those of the
    assembled start pose."""
    units, m = linkage.coordinate_units, count_rows(linkage)
    n = len(units)
    lengths = tuple("m" if unit == "rad" else "1" for unit in units)
    turning = tuple("1" if unit == "rad" else "1/m" for unit in units)
    inertias = {("m", "m"): "kg.m2", ("m", "1"): "kg.m", ("1", "m"): "kg.m", ("1", "1"): "kg"}
    D_units = tuple(inertias[a, b] for a in lengths for b in lengths)
    starts = _at_start(linkage)
    text = "joint-space inertia"
    variables = [Variable("D", (n, n), D_units, starts["D"], text, kind="semidefinite")]
    if m:
        text = "Jacobian of the loop closures"
        variables.append(Variable("W", (m, n), lengths, starts["W"], text))
        variables.append(Variable("w", (m,), "m/s2", starts["w"], "Wdot qd"))
    space, text = linkage.space, "Jacobian of the operational point"
    J_units = tuple(u for turns in space.turns for u in (turning if turns else lengths))
    return [*variables, Variable("J_h", (space.size, n), J_units, starts["J_h"], text)]


def values(model: LinkageModel) -> dict[str, ca.SX]:
    """The values of these ports at the model's pose, for the virtual environment."""
    matrices = {"D": model.D, "J_h": model.J_h}
    return matrices | {"W": model.W, "w": model.w} if model.linkage.closed else matrices


def _at_start(linkage: Linkage) -> dict[str, tuple[float, ...]]:
    p = Signals("p", [*parameters(linkage), *start_parameters(linkage)])
    start = assemble(LinkageModel(linkage, p, p["q_start"], p["qd_start"]))
    assembled = ca.Function("assembled", [p.vector], list(start))
    model, defaults = LinkageModel.symbolic(linkage, p), ca.DM(p.starts)
    matrices = values(model)
    rows = [ca.vec(ca.densify(value).T) for value in matrices.values()]
    evaluated = ca.Function("evaluated", [model.q, model.qd, p.vector], rows)
    numbers = evaluated.call([*assembled.call([defaults]), defaults])
    return {
        name: tuple(float(x) for x in column.elements())
        for name, column in zip(matrices, numbers, strict=True)
    }


def held_terms(model: LinkageModel, u: Mapping[str, ca.SX]) -> Terms:
    """The terms of (B.15) from the ports `u`."""
    n, loop = model.q.numel(), model.linkage.closed
    W = u["W"] if loop else ca.SX(0, n)
    k = added_inertia(model, W)
    return Terms(
        inertia=MatrixInertia(u["D"] + FLOOR * ca.diag(k), k, model.leaf_to_root),
        W=W,
        w=u["w"] if loop else ca.SX(0, 1),
        J_h=u["J_h"],
        Jdot_qd=ca.SX(model.linkage.space.size, 1),
        efforts=forces.efforts(model),
    )
