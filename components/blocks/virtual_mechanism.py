"""The virtual mechanism: the linkage's own dynamics, at the rate of the haptic loop.

    D qdd + C qd = Q + J_h' (F_hand - F_drift) + W' lambda,   W qdd + w_stab = 0   (B.6)
    w_stab = w + 2 alpha beta W qd + alpha^2 h                                  (B.5) as corrected

Contacts and joint limits add Q = sum_i J_i' F_i, and steps locate where they begin and end. The
scene chooses how the closures are stabilised: not at all, by Baumgarte's method, or by projection
of position and velocity after each step. The start pose is assembled in initialisation mode.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import casadi as ca

from hapticlink.components import forces, integrators, time_signals
from hapticlink.components.blocks.mechanism_parts import MechanismParts
from hapticlink.components.blocks.mechanism_steps import DEFLECTIONS, MechanismSteps
from hapticlink.components.blocks.step_defaults import StepDefaults
from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.contact import contact_forces, joint_limits, kept_sides
from hapticlink.components.contact.contact_forces import ContactForces
from hapticlink.components.contact.detection import touches
from hapticlink.components.contact.joint_limits import JointLimits
from hapticlink.components.contact.kept_sides import KeptSides
from hapticlink.components.contact.one_sided_spring import AllOneSidedForces, OneSidedForces
from hapticlink.components.dynamics import (
    closure_diagnostics,
    further_points,
    grasp,
    joint_ports,
    local_model,
    starting_friction,
)
from hapticlink.components.dynamics.assembly import assemble, require_assembled
from hapticlink.components.dynamics.constrained_directions import ConstrainedDirections
from hapticlink.components.dynamics.equivalent_wrench import equivalent_wrench, wrench_output
from hapticlink.components.dynamics.light_bodies import notes, refuse_jumps, require_inertia
from hapticlink.components.dynamics.operational_space import OperationalSpace
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
from hapticlink.components.integrators.base import Integrator
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.ports import Power
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Directions, Linkage, Mechanism


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
    coupled: bool = False,
    followed: bool = False,
    handles: further_points.Handles = MappingProxyType({}),
) -> Component:
    """The FMU `virtual_mechanism`. With `directions` it has its own Lambda_inv and P_c as outputs;
    `felt`, the efforts of others (further hands, motors on joints) are in F_env, as contacts are;
    `users` are the further points that a device holds (further_points.py), and `handles` those of
    devices that do not render all directions; with frame_s (s) it is
    the local model (B.15), with D, W, w and J_h as inputs, held for a frame. Of a linkage with
    several points for the hand, `coupled` and `followed` are those of grasp.py.

    The parameter `step_size` starts at step_s (s), and `frame_size` at frame_s: defaults depend on
    them (step_defaults.py). length_scale (m) is L where `directions` does not give it. Raises
    AssemblyError where a loop does not close, MasslessError where a massless body is free to move,
    ValueError for an unknown method, for settings that do not fit it and for friction too stiff for
    step_s.
    """
    method = integrators.METHODS[mechanism.integrator]
    baumgarte = linkage.closed and mechanism.stabilization == "baumgarte"
    if reason := method.misfit(baumgarte=baumgarte, held=frame_s is not None):
        raise ValueError(f'`mechanism.integrator` = "{mechanism.integrator}": {reason}')
    if contacts and not contact_forces.places(linkage, contacts):
        contacts = None
    felt = felt and bool(linkage.point or joint_ports.inputs(linkage))
    parts = _Parts(linkage, mechanism, directions, contacts, frame_s, felt, users, method, handles)
    if linkage.choices:
        parts = replace(parts, coupled=coupled, followed=followed)
    defaults = StepDefaults(linkage, mechanism, contacts, step_s, frame_s)
    block = _block(parts, defaults, length_scale)
    defaults.define(block.p)
    equations = _Equations(parts, block)
    component = block.component(
        "virtual_mechanism",
        "Dynamics of the linkage under the wrenches of the hand and of the virtual coupling",
        "continuous",
        initial=equations.initial(),
        step=equations.step(),
        output=equations.output(),
        substeps=mechanism.substeps,
        memory=further_points.counts(users),
        state_notes=notes(equations.model),
        documentation=__doc__ or "",
        shared=not frame_s and not equations.touching,
        signals=equations.signals,
        parts=MechanismParts(block, linkage, mechanism, defaults.alpha_text),
    )
    require_assembled(component, equations.model)
    require_inertia(component, equations.model)
    return component


@dataclass(frozen=True)
class _Parts:
    """The parts of the mechanism, and the method that takes its steps."""

    linkage: Linkage
    mechanism: Mechanism
    directions: Directions | None
    contacts: Contacts | None
    frame_s: float | None
    felt: bool
    users: further_points.Users
    method: Integrator
    handles: further_points.Handles
    coupled: bool = False
    followed: bool = False

    @property
    def touches(self) -> bool:
        """Whether there are contacts or joint limits."""
        return bool(self.contacts) or self.linkage.limited


def _block(parts: _Parts, defaults: StepDefaults, length_scale: float | None) -> Block:
    """The variables of the parts."""
    linkage, directions, contacts = parts.linkage, parts.directions, parts.contacts
    space = linkage.space
    drift = "virtual coupling, acts with - on the mechanism"
    moved = grasp.PATH if linkage.choices else "x"
    inputs = [
        Variable("F_hand", *space.wrench, description="wrench of the hand", power=Power(moved)),
        Variable("F_drift", *space.wrench, description=drift, power=Power(moved, sign=-1.0)),
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
        outputs.append(wrench_output(space))
    if parts.touches:
        parameters += joint_limits.parameters(linkage)
    if contacts:
        parameters += contact_forces.contact_parameters(linkage, contacts)
        outputs.append(contact_forces.gap_output())
        memory += contact_forces.states(linkage, contacts)
        if contacts.detection == "graphics":
            inputs.append(contact_forces.contact_port(linkage, contacts))
        else:
            memory += kept_sides.states(linkage, contacts)
    for name, text in parts.method.counters.items():
        memory.append(Variable(name))
        outputs.append(Variable(name, (), "1", description=text))
    if directions:
        memory += [Variable(name) for name in further_points.counts(parts.users)]
        parameters += direction_parameters(directions)
        outputs.append(mobility_output(space))
        for user in ("", *parts.users):
            outputs += direction_outputs(space, user)
    if linkage.choices:
        inputs += grasp.inputs(linkage, coupled=parts.coupled, followed=parts.followed)
        parameters += grasp.parameters(linkage)
        memory += grasp.states(linkage)
        outputs += grasp.outputs(linkage)
    return Block(inputs=inputs, parameters=parameters, states=memory, outputs=outputs)


class _Equations:
    """The expressions of the block in its symbols."""

    def __init__(self, parts: _Parts, block: Block) -> None:
        self._parts, self._block = parts, block
        self.signals = drives.signals(parts.linkage)
        tabled = ca.SX.sym("tabled", 2 * len(self.signals))
        pose = block.x["q"], block.x["qd"]
        deflection, point = block.x.get("deflection"), block.x.get(grasp.HELD)
        self.model = LinkageModel(parts.linkage, block.p, *pose, tabled, block.t, deflection, point)
        self._grasp = None if point is None else grasp.Grasp(block, self.model)
        held = local_model.held_terms(self.model, block.u) if parts.frame_s else None
        self._space = OperationalSpace(self.model, held)
        drawn = self._space.terms.J_h.T @ (block.u["F_hand"] - block.u["F_drift"])
        self._others = further_points.efforts(self.model, block.u)
        self._others += joint_ports.efforts(self.model, block.u)
        self._applied = drawn + self._others
        self._pushed = ca.SX(self.model.q.numel(), 1)
        self._energy = self.model.kinetic_energy + forces.energy(self.model)
        if self.touching:
            self._pushed = self.touching.efforts()
            self._energy += self.touching.energy

    @cached_property
    def _contact(self) -> ContactForces | None:
        model, contacts, block = self.model, self._parts.contacts, self._block
        if not contacts:
            return None
        places = (
            touches(model, contacts, block.p, block.x.get(kept_sides.NAME))
            if contacts.detection == "haptics"
            else contact_forces.held_contacts(model, contacts, block.u["contacts"])
        )
        return ContactForces(model, contacts, block.p, places, block.x.get("contact_deflection"))

    @cached_property
    def touching(self) -> OneSidedForces | None:
        """Contacts and joint limits, None where there are neither."""
        contact: list[OneSidedForces] = [self._contact] if self._contact else []
        limits = [JointLimits(self._space)] if self._parts.linkage.limited else []
        return AllOneSidedForces([*contact, *limits]) if contact or limits else None

    @cached_property
    def _start(self) -> tuple[ca.SX, ca.SX]:
        """The assembled q and qd at t = 0."""
        p = self._block.p
        return assemble(LinkageModel(self._parts.linkage, p, p["q_start"], p["qd_start"]))

    @cached_property
    def _after(self) -> ca.SX:
        """q, qd and deflections after a step, and by how much the method's counters grow."""
        parts, model, n = self._parts, self.model, self.model.q.numel()
        acting = self._applied, self.touching, self._energy, self.signals
        steps = MechanismSteps(
            self._block,
            parts.mechanism,
            self._space,
            *acting,
            kept_sides=self._sides_in_step,
            held_point=self._grasp.held if self._grasp else None,
        )
        after = integrators.mechanism_step(parts.method, steps)
        if k := model.deflection.numel():
            after[2 * n : 2 * n + k] = friction.clip_deflection(model, after[2 * n : 2 * n + k])
        return after

    @cached_property
    def _sides(self) -> KeptSides | None:
        """The sides on which contacts are kept that the mechanism detects itself."""
        kept, contacts = self._block.x.get(kept_sides.NAME), self._parts.contacts
        return KeptSides(self.model, contacts, kept) if contacts and kept is not None else None

    @cached_property
    def _sides_in_step(self) -> ca.SX | None:
        return self._sides.in_step(self._block.h) if self._sides else None

    @cached_property
    def _directions(self) -> dict[str, ConstrainedDirections]:
        """The constrained directions of operational points by state, if there are any."""
        if not self._parts.directions:
            return {}
        moves = self._start[0], self._after[: self.model.q.numel()]
        points = self._grasp.points if self._grasp else None
        users, handles = self._parts.users, self._parts.handles
        return further_points.directions(self._block, self._space, users, *moves, points, handles)

    def initial(self) -> dict[str, ca.SX]:
        """All states at t = 0."""
        initial = dict(zip(("q", "qd"), self._start, strict=True)) | self._initial_deflections()
        if (kept := self._block.x.get(kept_sides.NAME)) is not None:
            initial[kept_sides.NAME] = ca.SX(*kept.shape)
        initial |= dict.fromkeys(self._parts.method.counters, ca.SX(0))
        initial |= {name: directed.first for name, directed in self._directions.items()}
        return initial | (self._grasp.initial if self._grasp else {})

    def _initial_deflections(self) -> dict[str, ca.SX]:
        """The deflections of friction at the start pose and rates: contacts have none, and are kept
        on no side."""
        x, (joints, contacts) = self._block.x, DEFLECTIONS
        initial = {name: ca.SX(*x[name].shape) for name in DEFLECTIONS if name in x}
        if joints in initial:
            Q = self._applied + self._pushed
            z = starting_friction.start(self._space, Q, *self._start, self._block.t)
            of_contacts = (x[name] for name in (contacts, kept_sides.NAME) if name in x)
            none = ca.vertcat(ca.SX(0, 1), *(ca.vec(state) for state in of_contacts))
            symbols = ca.vertcat(self.model.tabled, none)
            known = ca.vertcat(time_signals.at(self.signals, ca.SX(0)), ca.SX(*none.shape))
            if self._grasp:
                symbols = ca.vertcat(symbols, x[grasp.HELD])
                known = ca.vertcat(known, self._grasp.initial[grasp.HELD])
            initial[joints] = ca.substitute(z, symbols, ca.densify(known))
        return initial

    def step(self) -> ca.SX:
        """All states after h."""
        x, method, n = self._block.x, self._parts.method, self.model.q.numel()
        moved, growth = ca.vertsplit(
            self._after, [0, self._after.numel() - len(method.counters), self._after.numel()]
        )
        counted = (x[name] for name in method.counters)
        kept = ca.SX(0, 1)
        if self._sides and self._sides_in_step is not None:
            kept = ca.vec(self._sides.after_step(self._sides_in_step, moved[:n], self._block.p).T)
        q = refuse_jumps(self.model, moved[:n], moved[n : 2 * n], self._block.h)
        return ca.vertcat(
            *self.model.shortened(q, moved[n : 2 * n]),
            moved[2 * n :],
            kept,
            ca.vertcat(ca.SX(0, 1), *counted) + growth,
            *(directed.after for directed in self._directions.values()),
            *(self._grasp.begun.values() if self._grasp else ()),
        )

    def output(self) -> dict[str, ca.SX]:
        """All outputs."""
        parts, block, model, space = self._parts, self._block, self.model, self._space
        qdd, multipliers = space.motion(self._applied + self._pushed)
        output = {"x": model.x_h, "v": model.v_h, "q": model.q, "qd": model.qd, "qdd": qdd}
        output |= {"a_bias": space.a_bias, "energy": self._energy}
        if self._contact:
            output["contact_gap"] = self._contact.gap
        if self.touching or parts.felt:
            output["F_env"] = self._environment_wrench()
        if parts.linkage.closed:
            output |= {"lambda": multipliers, "closure_error": model.closure_error}
            if parts.mechanism.diagnostics:
                output |= closure_diagnostics.values(space.solver)
        mobility, efforts = parts.directions is not None, self._applied + self._pushed
        output |= further_points.values(space, block, parts.users, efforts, mobility=mobility)
        output |= joint_ports.values(model)
        output |= {name: block.x[name] for name in parts.method.counters}
        if parts.directions:
            output["Lambda_inv"] = space.Lambda_inv
        for directed in self._directions.values():
            output |= directed.output
        output |= self._grasp.output if self._grasp else {}
        if not self.signals:
            return output
        now = ca.densify(time_signals.at(self.signals, block.t))
        return {name: ca.substitute(value, model.tabled, now) for name, value in output.items()}

    def _environment_wrench(self) -> ca.SX:
        """F_env, 3 x 1, of contacts, joint limits and others if they are felt."""
        space, J_h = self._space, self._space.terms.J_h
        efforts = self._pushed + (self._others if self._parts.felt else 0)
        acceleration = J_h @ space.response(efforts)[0]
        L = self._block.p["length_scale"]
        return equivalent_wrench(
            self.model.linkage.space, space.Lambda_inv, space.open_mobility(J_h), acceleration, L
        )
