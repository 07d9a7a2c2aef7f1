"""The virtual environment (the report's graphics block): a copy of the linkage at graphics rate.

It takes the mechanism's coordinates, projected onto the closures, or is pulled by a PD graphics
controller as in section 4.2.2.

It computes what would take too long at the haptic rate: Lambda^-1 (B.13), the projector on the
constrained directions (in place of B.14) and their number, the contact geometry, and whether it is
on the mechanism's branch.
"""

from __future__ import annotations

from types import MappingProxyType

import casadi as ca
import numpy as np

from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.contact import contact_forces, kept_sides
from hapticlink.components.contact.kept_sides import KeptSides
from hapticlink.components.dynamics import follow_mechanism, further_points, gradients, grasp
from hapticlink.components.dynamics import local_model as held_matrices
from hapticlink.components.dynamics.assembly import assemble, require_assembled
from hapticlink.components.dynamics.constrained_directions import ConstrainedDirections
from hapticlink.components.dynamics.light_bodies import require_inertia
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.variables import (
    direction_outputs,
    direction_parameters,
    directions_part,
    length_parameter,
    mobility_output,
    mobility_part,
    operational_point,
    parameters,
    start_parameters,
    states,
)
from hapticlink.components.linkage import branch
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.ports import FRAME_SIZE
from hapticlink.components.schematic_parts import BlockPart
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Directions, GraphicsCopy, Linkage, coordinates

_BRANCH = (
    Variable("branch_ok", description="1 on the mechanism's branch, 0 folded"),
    Variable("q_error", (), "1", description="norm of q_ref - q"),
)


def virtual_environment(
    linkage: Linkage,
    copy: GraphicsCopy,
    directions: Directions | None,
    contacts: Contacts | None = None,
    *,
    mobility: bool = True,
    local_model: bool = False,
    frame_s: float = 1 / 30,
    users: further_points.Users = (),
    predicted: bool = False,
    handles: further_points.Handles = MappingProxyType({}),
) -> Component:
    """The FMU `virtual_environment` with the outputs that are requested: `mobility` Lambda_inv,
    `directions` P_c and n_constraints, `contacts` their geometry, `local_model` D, W, w and J_h
    (B.15). Mobility and directions are those of the operational point and of the further points of
    `users`, `handles` those of devices that do not render all directions; `predicted`: at predicted
    coordinates, with their gradients (gradients.py). frame_s (s) is where the parameter
    `frame_size` starts, for contacts.

    Raises AssemblyError where a loop does not close, MasslessError where a massless body is free.
    """
    if contacts and not contact_forces.places(linkage, contacts):
        contacts = None
    counts = further_points.counts(users) if directions else []
    sides = kept_sides.states(linkage, contacts) if contacts else []
    ready = [Variable(grasp.READY)] if linkage.choices else []
    block = Block(
        inputs=[*follow_mechanism.inputs(linkage, copy), *grasp.inputs_of_copy(linkage)],
        parameters=_parameters(linkage, copy, directions, contacts, frame_s),
        states=[
            *states(linkage),
            *(gradients.states(linkage) if predicted else []),
            *(Variable(name) for name in counts),
            *sides,
            *ready,
        ],
        outputs=_outputs(linkage, directions, contacts, users, mobility, local_model, predicted),
    )
    model = LinkageModel(
        linkage, block.p, block.x["q"], block.x["qd"], point=block.x.get(grasp.READY)
    )
    q1, qd1 = model.shortened(*follow_mechanism.step(block, model, copy))
    q0, qd0 = assemble(LinkageModel(linkage, block.p, block.p["q_start"], block.p["qd_start"]))
    initial, step = {"q": q0, "qd": qd0}, {"q": q1, "qd": qd1}
    output = {"x": model.x_h, "v": model.v_h, "q": model.q}
    space, q_next = OperationalSpace(model), q1
    if predicted:
        q = block.x[gradients.PREDICTED]
        initial[gradients.PREDICTED], output[gradients.PREDICTED] = q0, q
        step[gradients.PREDICTED] = q_next = gradients.predict(block, q1, qd1)
        point = block.x.get(grasp.READY)
        space = OperationalSpace(LinkageModel(linkage, block.p, q, block.x["qd"], point=point))
    if mobility:
        output |= {"Lambda_inv": space.Lambda_inv} | further_points.mobilities(space, users)
    found: dict[str, ConstrainedDirections] = {}
    if directions:
        points = grasp.points_of_copy(block) if linkage.choices else None
        found = further_points.directions(block, space, users, q0, q_next, points, handles)
        for name, directed in found.items():
            initial[name], step[name] = directed.first, directed.after
            output |= directed.output
    if predicted:
        output |= gradients.values(space, users, found, mobility=mobility)
    if linkage.closed:
        output |= _branch(block, model)
    if contacts:
        kept = block.x.get(kept_sides.NAME)
        if kept is not None:
            initial[kept_sides.NAME] = ca.SX(*kept.shape)
            step[kept_sides.NAME] = KeptSides(model, contacts, kept).between(q1, block.p)
        held_s = block.p[FRAME_SIZE]
        output["contacts"] = contact_forces.detect_contacts(model, contacts, kept, held_s)
    if local_model:
        output |= held_matrices.values(model)
    if linkage.choices:
        initial[grasp.READY] = step[grasp.READY] = block.u[grasp.ASKED]
        output[grasp.READY] = block.x[grasp.READY]
    component = block.component(
        "virtual_environment",
        "Graphics-rate copy of the linkage, its mobility and constrained directions",
        "frame",
        initial=initial,
        step=step,
        output=output,
        substeps=1 if copy.sync == "exact" else copy.substeps,
        memory=counts,
        documentation=__doc__ or "",
        parts=_schematic(block, copy),
    )
    require_assembled(component, model)
    require_inertia(component, model)
    return component


def _parameters(
    linkage: Linkage,
    copy: GraphicsCopy,
    directions: Directions | None,
    contacts: Contacts | None,
    frame_s: float,
) -> list[Variable]:
    variables = [*parameters(linkage), *start_parameters(linkage)]
    variables += follow_mechanism.gains(linkage, copy)
    if directions:
        variables.append(length_parameter(linkage, directions.length_scale))
        variables += direction_parameters(directions)
    if contacts:
        text = "step size of the graphics copy"
        variables.append(Variable(FRAME_SIZE, (), "s", frame_s, text, "fixed"))
        variables += contact_forces.detection_parameters(linkage, contacts)
    return variables


def _outputs(
    linkage: Linkage,
    directions: Directions | None,
    contacts: Contacts | None,
    users: further_points.Users,
    mobility: bool,
    local_model: bool,
    predicted: bool,
) -> list[Variable]:
    units, space = linkage.coordinate_units, linkage.space
    matrices = [
        *([mobility_output(space)] if mobility else []),
        *(direction_outputs(space) if directions else []),
        *(mobility_output(space, f"{name}.", name) for name in users if mobility),
        *(output for name in users if directions for output in direction_outputs(space, name)),
    ]
    shaped = (v for v in matrices if v.shape)
    return [
        Variable("x", *space.pose, description="pose of the copy's operational point"),
        Variable("v", *space.twist, description="its velocity", derivative_of="x"),
        Variable("q", (len(units),), units, description="the copy's coordinates"),
        *matrices,
        *(gradients.outputs(linkage, shaped) if predicted else ()),
        *(_BRANCH if linkage.closed else []),
        *([contact_forces.contact_port(linkage, contacts)] if contacts else []),
        *(held_matrices.ports(linkage) if local_model else []),
        *grasp.outputs_of_copy(linkage),
    ]


def _schematic(block: Block, copy: GraphicsCopy) -> list[BlockPart]:
    """The parts, in the order of their evaluation; what is no output of the block has none."""
    outputs = [v.name for v in block.outputs]
    parts = [*follow_mechanism.parts(copy), operational_point(("x", "v"))]
    if grasp.READY in block.x:
        parts.append(
            BlockPart(
                "point in the hand", "the one that is asked for", "", (grasp.ASKED,), (grasp.READY,)
            )
        )
    if gradients.PREDICTED in outputs:
        parts.append(gradients.part(outputs))
    mobilities = tuple(name for name in outputs if name.endswith("Lambda_inv"))
    if mobilities:
        parts.append(mobility_part(mobilities))
    directions = tuple(name for name in outputs if name.endswith(("P_c", "n_constraints")))
    if directions:
        counted = tuple(name for name in block.x if name.endswith("n_constrained"))
        parts.append(directions_part(mobilities or ("q",), (*directions, *counted)))
    if "contacts" in outputs:
        kept = tuple(name for name in block.x if name == kept_sides.NAME)
        parts.append(
            BlockPart(
                "contact geometry",
                "gaps, normals, places",
                "section 4.2.2",
                ("q",),
                ("contacts", *kept),
            )
        )
    if matrices := tuple(name for name in ("D", "W", "w", "J_h") if name in outputs):
        text = ", ".join(held_matrices.SYMBOLS[name] for name in matrices)
        parts.append(
            BlockPart(
                "local model's matrices", f"${text}$", "(B.15), fig. B.3", ("q", "qd"), matrices
            )
        )
    if "branch_ok" in outputs:
        text = r"$\mathrm{sign}\,\det W_d$, $\|q_{ref} - q\|$"
        parts.append(BlockPart("branch", text, "", ("q", "q_ref"), ("branch_ok", "q_error")))
    return parts


def _branch(block: Block, model: LinkageModel) -> dict[str, ca.SX]:
    linkage, q_ref = model.linkage, block.u["q_ref"]
    start = np.array([*coordinates(linkage, linkage.start), *block.p.starts])
    rows, columns = branch.dependent_coordinates(model, start)
    W = ca.Function("W", [model.q, block.p.vector], [model.W])
    signs = [branch.branch_sign(W(q, block.p.vector), rows, columns) for q in (model.q, q_ref)]
    return {"branch_ok": signs[0] * signs[1] >= 0, "q_error": ca.norm_2(q_ref - model.q)}
