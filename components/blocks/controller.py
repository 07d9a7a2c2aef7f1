"""Controller of the haptic device: impedance, teleoperation and topology parts in one block.

    u = M_d [Lambda^-1 (F_h + F_drift + F_env - B_d v - K_d (x - x_ref)) + a_bias]
        + C_d v - F_h + F_T

so that with (4.5) the device accelerates as the mechanism would. It is the report's (4.6) with
(4.3) as corrected: as printed, F_h occurs both in M_d Lambda^-1 F_HD and in (M_d Lambda^-1 - I)
F_h, so that the hand's wrench would count twice; F_T stays outside Lambda^-1.

    F_drift = K_pc (x_S - x_D) + B_pc (v_S - v_D)

is the virtual coupling, the two position channels of the four-channel controller (section 4.2.3);
its force channels are connections, the hand's wrench to the mechanism and F_env to the device. A
passivity controller may take damping off u. Parts that are off have no term, no input and no
parameter; without the impedance part the wrenches act on the device as they are,

    u = F_drift + F_env - B_d v - K_d (x - x_ref) + F_T

Only a passivity controller has memory.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.control import passivity, topology
from hapticlink.components.dynamics import grasp
from hapticlink.components.dynamics.rendered_directions import (
    RenderedDirections,
    rendered_directions,
)
from hapticlink.components.port_space import PortSpace
from hapticlink.components.ports import SpringPorts
from hapticlink.components.schematic_parts import BlockPart
from hapticlink.components.specs.control import Controller, PassivityLaw, Topology
from hapticlink.components.specs.device import Handle

_DRIFT = SpringPorts("x_S", "x_D", "K_pc", "B_pc", "v_S", velocity="v_D", force="F_drift")
"""F_drift between the operational point and the handle."""


def _signals(
    spec: Controller, space: PortSpace, law: Topology | None, clutch: bool
) -> list[Variable]:
    """The inputs that the chosen parts need."""
    coupled, shaped = bool(spec.teleoperation or law), spec.impedance
    posed = coupled or spec.stiffness is not None or bool(spec.passivity)
    inertial = bool(shaped or law or spec.passivity)
    coriolis = "C_d v, Coriolis and centrifugal terms of the device"
    bias = "operational acceleration at zero wrench"
    rows = (
        ("x_S", *space.pose, 0.0, "pose of the operational point", coupled),
        ("v_S", *space.twist, 0.0, "velocity of the operational point", coupled),
        ("x_D", *space.pose, 0.0, "pose of the handle", posed),
        ("v_D", *space.twist, 0.0, "velocity of the handle", coupled or spec.damping is not None),
        ("F_hand", *space.wrench, 0.0, "wrench of the hand", shaped),
        ("F_env", *space.wrench, 0.0, "wrench of contacts and others", spec.contact),
        ("M", *space.inertia, space.identity, "inertia of the device", inertial),
        ("c", *space.wrench, 0.0, coriolis, shaped),
        (
            "Lambda_inv",
            *space.mobility,
            space.identity,
            "mobility at the operational point",
            shaped,
        ),
        ("P_c", *space.projector, 0.0, "projector on the constrained directions", bool(law)),
        ("a_bias", *space.acceleration, 0.0, bias, spec.bias == "full"),
    )
    signals = [Variable(*declared) for *declared, needed in rows if needed]
    return [*signals, grasp.CLUTCH] if clutch else signals


def _gains(
    spec: Controller, space: PortSpace, law: Topology | None, length_scale: float
) -> list[Variable]:
    gains = []
    if spec.damping is not None:
        gains += [Variable("B_d", *space.damping, spec.damping, "desired damping")]
    if spec.stiffness is not None:
        gains += [
            Variable("K_d", *space.stiffness, spec.stiffness, "desired stiffness"),
            Variable("x_ref", *space.pose, 0.0, "pose about which K_d acts", "fixed"),
        ]
    if spec.teleoperation:
        K_pc, B_pc = spec.teleoperation.stiffness, spec.teleoperation.damping
        gains += [
            Variable("K_pc", *space.stiffness, K_pc, "stiffness of the virtual coupling"),
            Variable("B_pc", *space.damping, B_pc, "damping of the virtual coupling"),
        ]
    if law:
        gains += [
            Variable("k_j", (), "1/s2", law.stiffness, "stiffness of F_T per unit of inertia"),
            Variable("b_j", (), "1/s", law.damping, "damping of F_T per unit of inertia"),
            Variable("length_scale", (), "m", length_scale, "L of S = diag(1, 1, L)"),
        ]
    return gains


def _outputs(
    spec: Controller, space: PortSpace, law: Topology | None, clutch: bool
) -> list[Variable]:
    outputs = [Variable("F_motor", *space.wrench, description="u, desired wrench of the motors")]
    if spec.teleoperation:
        text = "virtual coupling, + on the device, - on the mechanism"
        outputs += [Variable("F_drift", *space.wrench, description=text)]
    if law:
        text = "F_T, wrench of the topology controller"
        outputs += [Variable("F_constraint", *space.wrench, description=text)]
    if clutch:
        text = "energy in the springs of F_drift and F_T, lost where the hand lets go"
        outputs += [Variable("coupling_energy", (), "J", description=text)]
    return outputs


def controller(
    spec: Controller,
    space: PortSpace,
    length_scale: float,
    *,
    clutch: bool = False,
    handle: Handle | None = None,
) -> Component:
    """The controller of a port with the parts of `spec` that are on. length_scale is L (m). With a
    clutch it has the input held_point (grasp.py): while the hand holds no point of the mechanism,
    F_drift, F_env and F_T are 0 and the device has its own inertia,
    u = C_d v - B_d v - K_d (x - x_ref). handle: of a device that does not render all directions
    (rendered_directions.py); u is then E' M_d R (Lambda^-1 (...) + a_bias) + ..., with all else as
    it is along E. coupling_energy is that of the stiffnesses of F_drift and
    F_T, e' K e/2.

    Raises ValueError for bias "full" without the impedance part, which carries it.
    """
    if spec.bias == "full" and not spec.impedance:
        raise ValueError(
            "`controller.bias` = 'full' adds to the impedance law, and `controller.impedance` "
            "is false: turn impedance on, or take bias = 'none'"
        )
    law = Topology() if spec.topology is True else (spec.topology or None)
    guard = PassivityLaw() if spec.passivity is True else (spec.passivity or None)
    outputs, parameters = _outputs(spec, space, law, clutch), _gains(spec, space, law, length_scale)
    states: list[Variable] = []
    if guard:
        parameters += [*passivity.parameters(guard), passivity.PERIOD]
        states = passivity.states(guard, space)
        outputs += passivity.OUTPUTS
    block = Block(
        inputs=_signals(spec, space, law, clutch),
        parameters=parameters,
        states=states,
        outputs=outputs,
    )
    rendered = rendered_directions(handle)
    output, parts = _wrenches(spec, space, law, block, rendered)
    mobility = "Lambda_inv" if spec.impedance and not clutch else ""
    is_spring = spec.teleoperation and (rendered.whole or rendered.is_angle_fixed)
    initial: dict[str, ca.SX] = {}
    step: dict[str, ca.SX] = {}
    if guard:
        u, F = block.u, output["F_motor"]
        guarded = passivity.passive(F, u["x_D"], u["M"], block.x, block.p)
        initial, step = guarded.initial, guarded.step
        output |= guarded.output | {"F_motor": guarded.wrench}
        (*parts, last) = parts
        reads = ("u", "x_D", "M")
        parts += [replace(last, gives=("u",)), passivity.part(guard, space, reads, "F_motor")]
    return block.component(
        "controller",
        "Impedance, four-channel teleoperation and topology controller",
        "sampled",
        initial=initial,
        step=step,
        output=output,
        documentation=__doc__ or "",
        springs=[replace(_DRIFT, mobility=mobility)] if is_spring else [],
        parts=parts,
    )


def _wrenches(
    spec: Controller,
    space: PortSpace,
    law: Topology | None,
    block: Block,
    rendered: RenderedDirections,
) -> tuple[dict[str, ca.SX], list[BlockPart]]:
    """u of the motors, before the passivity controller, with F_drift and F_T where they are; and
    the parts that make them, of which the last gives F_motor."""
    u, p = block.u, block.p
    output: dict[str, ca.SX] = {}
    parts, terms, reads = list[BlockPart](), "", list[str]()
    force, env, coupling_energy = ca.SX.zeros(space.size), ca.SX.zeros(space.size), ca.SX(0)
    apart = ("x_S", "v_S", "x_D", "v_D")
    clutch = (grasp.HELD,) if grasp.HELD in u else ()
    e, rate = ca.SX(0), ca.SX(0)
    if spec.teleoperation or law:
        e, rate = space.difference(u["x_S"], u["x_D"]), u["v_S"] - u["v_D"]
    if spec.teleoperation:
        spring = rendered.coupled(p["K_pc"] * e)
        coupling_energy += ca.dot(e, spring) / 2
        output["F_drift"] = grasp.while_held(u, spring + rendered.coupled(p["B_pc"] * rate))
        force += output["F_drift"]
        law_text = r"$F_{drift} = K_{pc} (x_S - x_D)$" "\n" r"$+ B_{pc} (v_S - v_D)$"
        gains = (*apart, "K_pc", "B_pc", *clutch)
        parts.append(
            BlockPart("position channels", law_text, "sections 4.2.3, B.6", gains, ("F_drift",))
        )
        terms, reads = " + F_{drift}", ["F_drift"]
    if spec.contact:
        env = grasp.while_held(u, u["F_env"])
        force += env
        terms, reads = terms + " + F_{env}", [*reads, "F_env", *clutch]
    if spec.damping is not None:
        force -= p["B_d"] * u["v_D"]
        terms, reads = terms + " - B_d v_D", [*reads, "v_D", "B_d"]
    if spec.stiffness is not None:
        force -= p["K_d"] * space.difference(u["x_D"], p["x_ref"])
        terms, reads = terms + " - K_d (x_D - x_{ref})", [*reads, "x_D", "K_d", "x_ref"]

    motor, summed = rendered.mask(force), terms.removeprefix(" + ") or "0"
    if spec.impedance:
        # The effect of what acts on the mechanism from elsewhere is that of all of F_env.
        pushed = force if rendered.whole else rendered.mask(force - env) + env
        a = u["Lambda_inv"] @ (rendered.mask(u["F_hand"]) + pushed)
        desired = rf"$a = \Lambda^{{-1}} (F_h{terms})$"
        reads = ["Lambda_inv", "F_hand", *reads]
        if spec.bias == "full":
            a += u["a_bias"]
            desired, reads = desired + "\n" r"$+ a_{bias}$", [*reads, "a_bias"]
        along = rendered.acceleration(u["Lambda_inv"], a)
        accelerating = rendered.put(rendered.pick_matrix(u["M"]) @ along)
        own = u["c"] - rendered.mask(u["F_hand"])
        motor = grasp.while_held(u, accelerating + own, u["c"] + motor)
        parts.append(BlockPart("desired motion", desired, "(4.3), (4.4)", tuple(reads), ("a",)))
        summed, reads = "M_d a + C_d v - F_h", ["M", "a", "c", "F_hand", *clutch]
    if law:

        def constrain(pull: ca.SX) -> ca.SX:
            given = u["M"], u["P_c"], p["length_scale"], rendered
            return topology.constraint_wrench(space, pull, *given)

        F_T = grasp.while_held(u, constrain(p["k_j"] * e + p["b_j"] * rate))
        coupling_energy += ca.dot(e, constrain(p["k_j"] * e)) / 2
        output["F_constraint"], motor = F_T, motor + F_T
        pulled = (*apart, "M", "P_c", "k_j", "b_j", "length_scale", *clutch)
        parts.append(
            BlockPart(
                "topology controller", topology.LAW, "section 4.2.4", pulled, ("F_constraint",)
            )
        )
        summed, reads = f"{summed} + F_T", [*reads, "F_constraint"]
    name, source = ("impedance law", "(4.6), corrected") if spec.impedance else ("sum", "")
    parts.append(
        BlockPart(name, f"$u = {summed}$", source, tuple(dict.fromkeys(reads)), ("F_motor",))
    )
    if clutch:
        output["coupling_energy"] = grasp.while_held(u, coupling_energy)
        known = ("x_S", "x_D", "K_pc", "k_j", "M", "P_c", "length_scale", grasp.HELD)
        springs = tuple(name for name in known if name in u or name in p)
        law_text = r"$E = (e \cdot K_{pc} e + e \cdot F_T(k_j e)) / 2$"
        parts.append(BlockPart("coupling's springs", law_text, "", springs, ("coupling_energy",)))
    return output | {"F_motor": motor}, parts
