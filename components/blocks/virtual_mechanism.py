"""The virtual mechanism: the linkage's own dynamics, at the rate of the haptic loop.

    D qdd + C qd = Q + J_h' (F_hand - F_drift) + W' lambda,   W qdd + w_stab = 0   (B.6)
    w_stab = w + 2 alpha beta W qd + alpha^2 h                                  (B.5) as corrected

Contacts and joint limits add Q = sum_i J_i' F_i (contact_forces.py, joint_limits.py), and steps
locate where they begin and end (located_events.py). The scene chooses how the closures are
stabilised: not at all, by Baumgarte's method, or by projection of position and velocity after each
step. The start pose is assembled in initialisation mode.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from hapticlink.components import forces, integrators, time_signals
from hapticlink.components.blocks.mechanism_steps import DEFLECTIONS, MechanismSteps
from hapticlink.components.blocks.step_defaults import StepDefaults
from hapticlink.components.component import (
    WRENCH,
    Block,
    Component,
    Variable,
)
from hapticlink.components.contact import contact_forces, joint_limits
from hapticlink.components.contact.contact_forces import ContactForces
from hapticlink.components.contact.detection import touches
from hapticlink.components.contact.joint_limits import JointLimits
from hapticlink.components.contact.unilateral import AllOneSidedForces, OneSidedForces
from hapticlink.components.dynamics import (
    closure_diagnostics,
    further_points,
    joint_ports,
    local_model,
    starting_friction,
)
from hapticlink.components.dynamics.assembly import assemble, require_assembled
from hapticlink.components.dynamics.equivalent_wrench import equivalent_wrench, wrench_output
from hapticlink.components.dynamics.massless_bodies import carried, notes, require_inertia
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.passive_midpoint import (
    require_fitting,
    stops_output,
)
from hapticlink.components.dynamics.variables import (
    direction_outputs,
    direction_parameters,
    length_parameter,
    mechanism_parameters,
    mobility_output,
    motion_outputs,
    states,
)
from hapticlink.components.forces import drives, friction
from hapticlink.components.integrators.passive_midpoint import PassiveMidpoint
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.ports import Power
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Directions, Linkage, Mechanism
from hapticlink.components.time_signals import TimeSignal


def virtual_mechanism(
    linkage: Linkage,
    mechanism: Mechanism,
    directions: Directions | None = None,
    contacts: Contacts | None = None,
    *,
    step_s: float | None = None,
    length_scale: float | None = None,
    frame_s: float | None = None,
    felt: bool = False,
    users: further_points.Users = (),
) -> Component:
    """The FMU `virtual_mechanism`. With `directions` it has its own Lambda_inv and P_c as outputs;
    `felt`, the efforts of others (further hands, motors on joints) are in F_env, as contacts are;
    `users` are the further points that a device holds (further_points.py); with frame_s (s) it is
    the local model (B.15), with D, W, w and J_h as inputs, held for a frame.

    The parameter `step_size` starts at step_s (s), and `frame_size` at frame_s: defaults depend on
    them (step_defaults.py). length_scale (m) is L where `directions` does not give it. Raises
    AssemblyError where a loop does not close, MasslessError where a massless body is free to move,
    ValueError for an unknown method, for settings that do not fit it and for friction too stiff for
    step_s.
    """
    require_fitting(mechanism, linkage, held=frame_s is not None)
    if contacts and not contact_forces.places(linkage, contacts):
        contacts = None
    felt = felt and bool(linkage.point or joint_ports.inputs(linkage))
    parts = _Parts(linkage, mechanism, directions, contacts, frame_s, felt, users)
    defaults = StepDefaults(linkage, mechanism, contacts, step_s, frame_s)
    block = _block(parts, defaults, length_scale)
    defaults.define(block.p)
    signals = drives.signals(linkage)
    tabled = ca.SX.sym("tabled", 2 * len(signals))
    at = block.x["q"], block.x["qd"]
    model = LinkageModel(linkage, block.p, *at, tabled, block.t, block.x.get("deflection"))
    space = OperationalSpace(model, local_model.held(model, block.u) if frame_s else None)
    applied = space.terms.J_h.T @ (block.u["F_hand"] - block.u["F_drift"])
    others = further_points.efforts(model, block.u) + joint_ports.efforts(model, block.u)
    applied += others
    energy = model.kinetic_energy + forces.energy(model)
    output: dict[str, ca.SX] = {}
    touching = _touching(parts, block, space, output)
    pushed = touching.efforts() if touching else ca.SX(model.q.numel(), 1)
    energy += touching.energy if touching else 0
    if touching or felt:
        J_h = space.terms.J_h
        acceleration = J_h @ space.response(pushed + (others if felt else 0))[0]
        output["F_env"] = equivalent_wrench(
            space.Lambda_inv, space.open_mobility(J_h), acceleration, block.p["length_scale"]
        )
    qdd, multipliers = space.motion(applied + pushed)
    output |= {
        "x": model.x_h,
        "v": model.v_h,
        "q": model.q,
        "qd": model.qd,
        "qdd": qdd,
        "a_bias": space.a_bias,
        "energy": energy,
    }
    if linkage.closed:
        output |= {"lambda": multipliers, "closure_error": model.closure_error}
        output |= closure_diagnostics.values(space.solver) if mechanism.diagnostics else {}
    output |= further_points.values(
        space, block, users, applied + pushed, mobility=directions is not None
    )
    output |= joint_ports.values(model)

    q0, qd0 = assemble(LinkageModel(linkage, block.p, block.p["q_start"], block.p["qd_start"]))
    initial = {"q": q0, "qd": qd0}
    initial |= _deflections(block, space, applied + pushed, initial, signals)
    steps = MechanismSteps(block, model, mechanism, applied, touching, signals)
    if parts.passive:
        initial["stops"], output["stops"] = ca.SX(0), block.x["stops"]
        after = steps.passive(energy)
    else:
        after = steps.integrated(space)
    n = model.q.numel()
    q1, qd1 = after[:n], after[n : 2 * n]
    if k := model.deflection.numel():
        after[2 * n : 2 * n + k] = friction.bounded(model, after[2 * n : 2 * n + k])
    stepped = ca.vertcat(carried(model, q1, qd1, block.h), after[n:])
    if directions:
        output["Lambda_inv"] = space.Lambda_inv
        for name, found in further_points.directions(block, space, users, q0, q1).items():
            initial[name], stepped = found.first, ca.vertcat(stepped, found.after)
            output |= found.output
    if signals:
        now = ca.densify(time_signals.at(signals, block.t))
        output = {name: ca.substitute(value, tabled, now) for name, value in output.items()}
    component = block.component(
        "virtual_mechanism",
        "Dynamics of the linkage under the wrenches of the hand and of the virtual coupling",
        "continuous",
        initial=initial,
        step=stepped,
        output=output,
        substeps=mechanism.substeps,
        memory=further_points.counts(users),
        state_notes=notes(model),
        documentation=__doc__ or "",
        shared=not frame_s and not touching,
        signals=signals,
    )
    require_assembled(component, model)
    require_inertia(component, model)
    return component


@dataclass(frozen=True)
class _Parts:
    """The parts of the mechanism."""

    linkage: Linkage
    mechanism: Mechanism
    directions: Directions | None
    contacts: Contacts | None
    frame_s: float | None
    felt: bool
    users: further_points.Users

    @property
    def passive(self) -> bool:
        """Whether the passive midpoint method takes the steps."""
        return isinstance(integrators.METHODS[self.mechanism.integrator], PassiveMidpoint)

    @property
    def touches(self) -> bool:
        """Whether there are contacts or joint limits."""
        return bool(self.contacts) or self.linkage.limited


def _block(parts: _Parts, defaults: StepDefaults, length_scale: float | None) -> Block:
    """The variables of the parts."""
    linkage, directions, contacts = parts.linkage, parts.directions, parts.contacts
    inputs = [
        Variable("F_hand", (3,), WRENCH, description="wrench of the hand", power=Power("x")),
        Variable(
            "F_drift",
            (3,),
            WRENCH,
            description="virtual coupling, acts with - on the mechanism",
            power=Power("x", sign=-1.0),
        ),
    ]
    parameters = mechanism_parameters(linkage, parts.mechanism, defaults.baumgarte.beta)
    parameters += defaults.parameters
    outputs = motion_outputs(linkage)
    inputs += [*further_points.inputs(linkage, parts.users), *joint_ports.inputs(linkage)]
    outputs += further_points.outputs(linkage, parts.users, mobility=directions is not None)
    outputs += joint_ports.outputs(linkage)
    if parts.frame_s:
        inputs += local_model.ports(linkage)
    if linkage.closed and parts.mechanism.diagnostics:
        outputs += closure_diagnostics.outputs()
    memory = [*states(linkage), *friction.states(linkage)]
    if parts.touches or parts.felt or parts.users or directions:
        length = directions.length_scale if directions else length_scale
        parameters.append(length_parameter(linkage, length))
    if parts.touches or parts.felt:
        outputs.append(wrench_output())
    if parts.touches:
        parameters += joint_limits.parameters(linkage)
    if contacts:
        parameters += contact_forces.contact_parameters(linkage, contacts)
        outputs.append(contact_forces.gap_output())
        memory += contact_forces.states(linkage, contacts)
        if contacts.detection == "graphics":
            inputs.append(contact_forces.contact_port(linkage, contacts))
    if parts.passive:
        memory.append(Variable("stops"))
        outputs.append(stops_output())
    if directions:
        memory += [Variable(name) for name in further_points.counts(parts.users)]
        parameters += direction_parameters(directions)
        outputs += [mobility_output(), *direction_outputs()]
        outputs += further_points.direction_outputs(parts.users)
    return Block(inputs=inputs, parameters=parameters, states=memory, outputs=outputs)


def _deflections(
    block: Block,
    space: OperationalSpace,
    Q: ca.SX,
    start: Mapping[str, ca.SX],
    signals: list[TimeSignal],
) -> dict[str, ca.SX]:
    """The deflections of friction at the start pose and rates: contacts have none."""
    joints, contacts = DEFLECTIONS
    found = {name: ca.SX(*block.x[name].shape) for name in DEFLECTIONS if name in block.x}
    if joints in found:
        z = starting_friction.start(space, Q, start["q"], start["qd"], block.t)
        none = block.x.get(contacts, ca.SX(0, 1))
        symbols = ca.vertcat(space.model.tabled, none)
        known = ca.vertcat(time_signals.at(signals, ca.SX(0)), ca.SX(*none.shape))
        found[joints] = ca.substitute(z, symbols, ca.densify(known))
    return found


def _touching(
    parts: _Parts, block: Block, space: OperationalSpace, output: dict[str, ca.SX]
) -> OneSidedForces | None:
    """Contacts and joint limits, None where there are neither, and their outputs."""
    model, contacts, found = space.model, parts.contacts, list[OneSidedForces]()
    if contacts:
        places = (
            touches(model, contacts, block.p)
            if contacts.detection == "haptics"
            else contact_forces.held(model, contacts, block.u["contacts"])
        )
        deflection = block.x.get("contact_deflection")
        contact = ContactForces(model, contacts, block.p, places, deflection)
        output["contact_gap"] = contact.gap
        found.append(contact)
    if parts.linkage.limited:
        found.append(JointLimits(space))
    if not found:
        return None
    return AllOneSidedForces(found)
