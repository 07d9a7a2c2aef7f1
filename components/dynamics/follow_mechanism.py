"""How the graphics copy follows the mechanism over a frame, by `graphics.sync`:

exact        The mechanism's q and qd are projected onto the closures once: the copy is where the
             mechanism was when the frame began. It cannot fold, at any rate.
operational  A PD graphics controller pulls the copy at the operational point (section 4.2.2). With
             the report's gains, B_g on an inertia of about 0.002 kg.m2 is too stiff for explicit
             steps at 10 to 60 Hz, so the motion is integrated linearly implicitly (h is a substep,
             velocity terms are explicit):

    (D + h J'B_g J + h^2 J'K_g J) qd+
        = D qd + h (J'(K_g (x_ref - x) + B_g v_ref) - C qd + W' lambda)
    W qd+ = 0,   q+ = q + h qd+, then projected on the closures

             Links whose motion does not move the operational point can fold to the other assembly.
joint        The same with every coordinate pulled, by an acceleration K_g (q_ref - q) + B_g qd_ref.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from hapticlink.components.component import Block, Variable
from hapticlink.components.dynamics.articulated_body import TreeInertia
from hapticlink.components.dynamics.closed_loop_solver import ClosedLoopSolver
from hapticlink.components.dynamics.projection import MU, projection
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.schematic_parts import BlockPart
from hapticlink.components.specs.linkage import GraphicsCopy, Linkage, coordinates


def inputs(linkage: Linkage, copy: GraphicsCopy) -> list[Variable]:
    """The copy's inputs from the mechanism; q_ref also where it only serves to compare branches."""
    units, space = linkage.coordinate_units, linkage.space
    pose, n = "pose of the mechanism's operational point", (len(units),)
    x_ref = Variable("x_ref", *space.pose, description=pose)
    v_ref = Variable("v_ref", *space.twist, description="its velocity")
    start = tuple(coordinates(linkage, linkage.start))
    q_ref = Variable("q_ref", n, units, start, "the mechanism's coordinates")
    qd_ref = Variable("qd_ref", n, linkage.rate_units, description="the mechanism's joint rates")
    if copy.sync == "operational":
        return [x_ref, v_ref, *([q_ref] if linkage.closed else [])]
    return [q_ref, qd_ref]


def gains(linkage: Linkage, copy: GraphicsCopy) -> list[Variable]:
    if copy.sync == "exact":
        return []
    if copy.sync == "joint":
        return [
            Variable("K_g", (), "1/s2", copy.joint_stiffness, "pull on a coordinate's error"),
            Variable("B_g", (), "1/s", copy.joint_damping, "pull on its rate"),
        ]
    space = linkage.space
    return [
        Variable("K_g", *space.stiffness, copy.stiffness, "stiffness of the graphics controller"),
        Variable("B_g", *space.damping, copy.damping, "damping of the graphics controller"),
    ]


_COPY = BlockPart(
    "copy of the linkage",
    r"$D \ddot{q} + C \dot{q} = J_h^T F_g + W^T \lambda$" "\n" r"$W \dot{q} = 0,\ h(q) = 0$",
    "4.2.2; linearly implicit", ("F_g",), ("q", "qd"),
)  # fmt: skip


def parts(copy: GraphicsCopy) -> list[BlockPart]:
    """The parts that give the copy's q and qd."""
    if copy.sync == "exact":
        law = r"$q = q_{ref} - W^+ h,\ h(q) = 0$" "\n" r"$\dot{q}$: so that $W \dot{q} = 0$"
        return [
            BlockPart(
                "projection", law, "in place of section 4.2.2", ("q_ref", "qd_ref"), ("q", "qd")
            )
        ]
    if copy.sync == "joint":
        law = r"$Q_g = D (K_g (q_{ref} - q)$" "\n" r"$+ B_g (\dot{q}_{ref} - \dot{q}))$"
        reads = ("q_ref", "qd_ref", "q", "qd", "K_g", "B_g")
        pulled = replace(_COPY, equation=_COPY.equation.replace("J_h^T F_g", "Q_g"), reads=("Q_g",))
        return [BlockPart("graphics controller (C)", law, "section 4.2.2", reads, ("Q_g",)), pulled]
    law = r"$F_g = K_g (x_{ref} - x)$" "\n" r"$+ B_g (v_{ref} - v)$"
    reads = ("x_ref", "v_ref", "x", "v", "K_g", "B_g")
    return [
        BlockPart("graphics controller (C)", law, "section 4.2.2, fig. 4.4", reads, ("F_g",)),
        _COPY,
    ]


def step(block: Block, model: LinkageModel, copy: GraphicsCopy) -> tuple[ca.SX, ca.SX]:
    """(q, qd) after a frame (exact) or a substep of it (pulled)."""
    if copy.sync == "exact":
        return _exact(block, model)
    return pull_copy(block, model, copy.sync == "joint")


def _exact(block: Block, model: LinkageModel) -> tuple[ca.SX, ca.SX]:
    reference = LinkageModel.symbolic(model.linkage, block.p)
    project = projection(reference, TreeInertia(reference))
    q, qd = project(block.u["q_ref"], block.u["qd_ref"], block.p.vector)
    return q, qd


def pull_copy(block: Block, model: LinkageModel, joint_sync: bool) -> tuple[ca.SX, ca.SX]:
    u, p, h, q, qd = block.u, block.p, block.h, model.q, model.qd
    D = TreeInertia(model)
    if joint_sync:
        solver = ClosedLoopSolver(D, model.W, model.rows, MU)
        pull = D.apply(p["K_g"] * (u["q_ref"] - q) + p["B_g"] * u["qd_ref"])
        weight = 1 + h * p["B_g"] + h**2 * p["K_g"]
    else:
        space, K_g, B_g = model.linkage.space, ca.diag(p["K_g"]), ca.diag(p["B_g"])
        added = {model.linkage.held.body: (model.x_h[:2], h * B_g + h**2 * K_g)}
        solver = ClosedLoopSolver(TreeInertia(model, added), model.W, model.rows, MU)
        pull = model.J_h.T @ (K_g @ space.difference(u["x_ref"], model.x_h) + B_g @ u["v_ref"])
        weight = ca.SX(1)
    momentum = D.apply(qd) + h * (pull - model.C_qd)
    qd1, _ = solver.solve(momentum / weight, ca.SX(solver.m, 1))
    # Projected twice, since a frame's motion is large for one factorisation of W.
    project = projection(model, D)
    closed, rate = project(*project(q + h * qd1, qd1, p.vector), p.vector)
    return closed, rate
