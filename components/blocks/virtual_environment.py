"""The virtual environment (the report's graphics block): a copy of the linkage at graphics rate.

A PD graphics controller pulls the copy to the haptic mechanism (section 4.2.2). With the
report's gains, B_g on an inertia of about 0.002 kg.m2 is stiff far beyond any explicit step of
10 to 60 Hz, so the pull is integrated linearly implicitly (h substep, velocity terms explicit):

    (D + h J'B_g J + h^2 J'K_g J) qd+
        = D qd + h (J'(K_g (x_ref - x) + B_g v_ref) - C qd + W' lambda)
    W qd+ = 0,   q+ = q + h qd+, then projected on the closures

It computes what the haptic side is too busy for: Lambda^-1 (B.13), the projector on the resisted
directions (in place of B.14) and their number, the contact geometry, and whether it is on the
mechanism's branch.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from hapticlink.components.component import POSE, TWIST, Block, Component, Variable
from hapticlink.components.contact import contact_forces
from hapticlink.components.dynamics import local_model as held_matrices
from hapticlink.components.dynamics.articulated_body import TreeInertia
from hapticlink.components.dynamics.assembly import assemble, require_closed
from hapticlink.components.dynamics.closed_loop_solver import ClosedLoopSolver
from hapticlink.components.dynamics.constrained_directions import resisted_directions
from hapticlink.components.dynamics.massless_bodies import require_inertia
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.projection import MU, projection
from hapticlink.components.dynamics.variables import (
    direction_outputs,
    direction_parameters,
    length_parameter,
    mobility_output,
    parameters,
    start_parameters,
    states,
)
from hapticlink.components.linkage import branch
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import coordinate_units, coordinates
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Directions, GraphicsCopy, Linkage


def virtual_environment(
    linkage: Linkage,
    copy: GraphicsCopy,
    directions: Directions | None,
    contacts: Contacts | None = None,
    *,
    mobility: bool = True,
    local_model: bool = False,
) -> Component:
    """The FMU `virtual_environment`, of what is asked: `mobility` is Lambda_inv, `directions` P_c
    and n_constraints, `contacts` their geometry, `local_model` D, W, w and J_h (B.15).

    Raises AssemblyError where a loop does not close, MasslessError where a massless body is free.
    """
    joint_sync = copy.sync == "joint"
    if contacts and not contact_forces.places(linkage, contacts):
        contacts = None
    units = coordinate_units(linkage)
    rates = tuple(f"{u}/s" for u in units)
    n = len(units)
    inputs = [
        Variable("x_ref", (3,), POSE, description="pose of the mechanism's operational point"),
        Variable("v_ref", (3,), TWIST, description="its velocity"),
    ]
    if joint_sync or linkage.loop:
        inputs.append(Variable("q_ref", (n,), units, description="the mechanism's coordinates"))
    if joint_sync:
        inputs = inputs[2:]
        inputs.append(Variable("qd_ref", (n,), rates, description="the mechanism's joint rates"))
    block = Block(
        inputs=inputs,
        parameters=[
            *parameters(linkage),
            *start_parameters(linkage),
            *_gains(copy),
            *(_direction_parameters(linkage, directions) if directions else []),
            *(contact_forces.detection_parameters(linkage, contacts) if contacts else []),
        ],
        states=[*states(linkage), *([Variable("n_resisted")] if directions else [])],
        outputs=[
            *_outputs(linkage, units),
            *([mobility_output()] if mobility else []),
            *(direction_outputs() if directions else []),
            *_branch_outputs(linkage),
            *([contact_forces.contact_port(linkage, contacts)] if contacts else []),
            *(held_matrices.ports(linkage) if local_model else []),
        ],
    )
    model = LinkageModel(linkage, block.p, block.x["q"], block.x["qd"])
    q1, qd1 = _pulled(block, model, joint_sync)
    q0, qd0 = assemble(LinkageModel(linkage, block.p, block.p["q_start"], block.p["qd_start"]))
    initial, step = {"q": q0, "qd": qd0}, {"q": q1, "qd": qd1}
    output = {"x": model.x_h, "v": model.v_h, "q": model.q}
    space = OperationalSpace(model)
    if mobility:
        output["Lambda_inv"] = space.Lambda_inv
    if directions:
        resisted = resisted_directions(block, space, q0, q1)
        initial["n_resisted"], step["n_resisted"] = resisted.first, resisted.after
        output |= resisted.output
    if linkage.loop:
        output |= _branch(block, model)
    if contacts:
        output["contacts"] = contact_forces.detected(model, contacts)
    if local_model:
        output |= held_matrices.values(model)
    component = block.component(
        "virtual_environment",
        "Graphics-rate copy of the linkage, its mobility and resisted directions",
        "continuous",
        initial=initial,
        step=step,
        output=output,
        substeps=copy.substeps,
        documentation=__doc__ or "",
    )
    require_closed(component, model)
    require_inertia(component, model)
    return component


def _gains(copy: GraphicsCopy) -> list[Variable]:
    if copy.sync == "joint":
        return [
            Variable("K_g", (), "1/s2", copy.joint_stiffness, "pull on a coordinate's error"),
            Variable("B_g", (), "1/s", copy.joint_damping, "pull on its rate"),
        ]
    stiffness, damping = ("N/m", "N/m", "N.m/rad"), ("N.s/m", "N.s/m", "N.m.s/rad")
    return [
        Variable("K_g", (3,), stiffness, copy.stiffness, "stiffness of the graphics controller"),
        Variable("B_g", (3,), damping, copy.damping, "damping of the graphics controller"),
    ]


def _direction_parameters(linkage: Linkage, directions: Directions) -> list[Variable]:
    length = length_parameter(linkage, directions.length_scale)
    return [length, *direction_parameters(directions)]


def _outputs(linkage: Linkage, units: tuple[str, ...]) -> list[Variable]:
    return [
        Variable("x", (3,), POSE, description="pose of the copy's operational point"),
        Variable("v", (3,), TWIST, description="its velocity", derivative_of="x"),
        Variable("q", (len(units),), units, description="the copy's coordinates"),
    ]


def _branch_outputs(linkage: Linkage) -> list[Variable]:
    if not linkage.loop:
        return []
    return [
        Variable("branch_ok", description="1 on the mechanism's branch, 0 folded"),
        Variable("q_error", (), "1", description="norm of q_ref - q"),
    ]


def _pulled(block: Block, model: LinkageModel, joint_sync: bool) -> tuple[ca.SX, ca.SX]:
    """(q, qd) after one linearly implicit substep."""
    u, p, h, q, qd = block.u, block.p, block.h, model.q, model.qd
    D = TreeInertia(model)
    if joint_sync:
        solver = ClosedLoopSolver(D, model.W, MU)
        pull = D.apply(p["K_g"] * (u["q_ref"] - q) + p["B_g"] * u["qd_ref"])
        weight = 1 + h * p["B_g"] + h**2 * p["K_g"]
    else:
        K_g, B_g = ca.diag(p["K_g"]), ca.diag(p["B_g"])
        held = {model.linkage.operational_point.body: (model.x_h[:2], h * B_g + h**2 * K_g)}
        solver = ClosedLoopSolver(TreeInertia(model, held), model.W, MU)
        pull = model.J_h.T @ (K_g @ (u["x_ref"] - model.x_h) + B_g @ u["v_ref"])
        weight = ca.SX(1)
    momentum = D.apply(qd) + h * (pull - model.C_qd)
    qd1, _ = solver.solve(momentum / weight, ca.SX(solver.m, 1))
    # Twice: a frame's motion is large for one chord of the closures.
    project = projection(model, D)
    closed, rate = project(*project(q + h * qd1, qd1, p.vector), p.vector)
    return closed, rate


def _branch(block: Block, model: LinkageModel) -> dict[str, ca.SX]:
    linkage, q_ref = model.linkage, block.u["q_ref"]
    start = [*coordinates(linkage, linkage.start)]
    defaults = [s for v in block.p.variables for s in v.starts]
    rows, columns = branch.dependent_coordinates(model, np.array([*start, *defaults]))
    W = ca.Function("W", [model.q, block.p.vector], [model.W])
    signs = [branch.branch_sign(W(q, block.p.vector), rows, columns) for q in (model.q, q_ref)]
    return {
        "branch_ok": signs[0] * signs[1] >= 0,
        "q_error": ca.norm_2(q_ref - model.q),
    }
