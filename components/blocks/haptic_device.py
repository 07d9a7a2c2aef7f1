"""Haptic device: twin pantograph, four motors, four encoders and the observer.

    M_d(x) v' + C_d(x, v) v = J_q' (tau + friction) + F_hand + stops        (4.5)

tau, the torques of least norm for F_motor at the pose measured at t_k, saturated, is held over the
communication step [t_k, t_k + h). A device without friction has no terms of it. At t = 0 the handle
is at rest at x_start and the observed force is zero.

Without encoders x and v are the true values. With them x is the pose that belongs to the quantised
base angles; v and F_hand_observed come from the observer. M and c = C_d v are evaluated at the
measured pose and velocity, workspace_margin at the true pose. All dimensions are assumed, since the
report gives only the 0.09 degrees of an encoder count.

With its observer beside it (block `observer`) the device takes torques tau (block `motor_map`) and
puts out q, the base angles by the encoders: counts times resolution; q_true, the angles themselves;
and tau_applied, the torques of the step that ends, 0 at t = 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import casadi as ca

from hapticlink.components import integrators
from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.device import observer_laws, pantograph
from hapticlink.components.device.motors_and_encoders import count
from hapticlink.components.device.variables import (
    ENCODERS,
    F_HAND_OBSERVED,
    FRICTION,
    GEOMETRY,
    INERTIA,
    STOPS,
    TORQUE_LIMIT,
    X_START,
    C,
    M,
    Rows,
    V,
    X,
    variables,
)
from hapticlink.components.port_space import PLANE
from hapticlink.components.ports import Power
from hapticlink.components.schematic_parts import BlockPart
from hapticlink.components.specs.device import Device

SPACE = PLANE
"""Of the port at the handle."""
MOTORS = (pantograph.MOTORS,)
_POWER = Power("x_true")
_F_MOTOR = Variable("F_motor", *SPACE.wrench, 0.0, "desired wrench of the motors", power=_POWER)
_TAU = Variable("tau", MOTORS, "N.m", 0.0, "torques of the motors", power=Power("q_true"))
_F_HAND = Variable("F_hand", *SPACE.wrench, 0.0, "wrench of the hand on the handle", power=_POWER)
_TRUE_OUTPUTS = [
    Variable(
        "workspace_margin",
        (),
        "m",
        0.0,
        "smallest distance of an arm to a stop, negative beyond it",
    ),
    Variable("x_true", *SPACE.pose, description="true pose of the handle"),
    Variable("v_true", *SPACE.twist, 0.0, "true velocity of the handle", derivative_of="x_true"),
]
_MEASURED_OUTPUTS = [
    Variable("q", MOTORS, "rad", description="base angles by the encoders: counts x resolution"),
    Variable("counts", MOTORS, "1", description="counts of the encoders"),
    Variable("tau_applied", MOTORS, "N.m", description="torques of the step that ends"),
    Variable("q_true", MOTORS, "rad", description="true base angles"),
]
_STATES = [
    Variable("x_true", *SPACE.pose, description="pose of the handle"),
    Variable("v_true", *SPACE.twist, description="velocity of the handle"),
]
_TAU_APPLIED = Variable("tau_applied", MOTORS, "N.m", description="torques of the step before")


def _parameters(device: Device, tunable: Rows) -> list[Variable]:
    friction = FRICTION if device.motor_damping or device.motor_friction else ()
    fixed = variables(device, (*GEOMETRY, *INERTIA), "fixed")
    return [X_START, *fixed, *variables(device, (*tunable, *friction), "tunable")]


def _plant(block: Block) -> ca.Function:
    """(x = [pose, v], u = [tau, F_hand], p, t) -> x' of (4.5)."""
    state, drive = ca.SX.sym("x", 6), ca.SX.sym("u", 7)
    pose, v, tau, F_hand = state[:3], state[3:], drive[:4], drive[4:]
    M, c = pantograph.motion(pose, v, block.p)
    J = pantograph.jacobian(pose, block.p)
    if "motor_friction" in block.p:
        tau = tau + pantograph.friction_torques(J @ v, block.p)
    wrench = J.T @ tau + F_hand
    wrench += pantograph.stop_wrench(pose, v, block.p) - c
    derivative = ca.vertcat(v, ca.solve(M, wrench))
    return ca.Function("ode", [state, drive, block.p.vector, block.t], [derivative])


def advance_device(block: Block, tau: ca.SX, substeps: int) -> ca.SX:
    """[x_true, v_true] after h, with the torques tau and the hand's wrench held."""
    plant, h, inputs = _plant(block), block.h / substeps, ca.vertcat(tau, block.u["F_hand"])
    motion = ca.vertcat(block.x["x_true"], block.x["v_true"])
    for i in range(substeps):
        t = block.t + i * block.h / substeps
        motion = integrators.step("heun", plant, motion, inputs, block.p.vector, t, h, [0, 1, 2])
    return motion


_MATRICES = BlockPart("inertia", r"$M_d(x),\ c = C_d(x, v)\,v$", "(4.5)", ("x", "v"), ("M", "c"))
_IDEAL = BlockPart("ideal sensing", r"$x = x_D,\ v = v_D$", "", ("x_true", "v_true"), ("x", "v"))
_MOTORS = BlockPart(
    "motors",
    r"$\tau = J_q^{T+} u$, at most" "\n" r"$|\tau_i| \leq \tau_{max}$",
    "section 4.2.1, fig. 4.2",
    ("F_motor", "x", "torque_limit"), ("tau",),
)  # fmt: skip
_COUNTED = BlockPart(
    "encoders", r"$q = \Delta\,[\varphi(x_D) / \Delta]$", "section 4.2.1, fig. 4.2",
    ("x_true", "encoder_resolution"), ("q", "counts", "q_true"),
)  # fmt: skip
_NICOSIA = (
    BlockPart(
        "encoders", r"$x = \arg\min_x \|\varphi(x)$" "\n" r"$- \Delta\,[\varphi(x_D) / \Delta]\|$",
        "section 4.2.1, fig. 4.2",
        ("x_true", "encoder_resolution"), ("x", "x_measured"),
    ),
    BlockPart(
        "Nicosia observer",
        r"$\dot{x}_1 = x_2 + k_D e,\ e = x - x_1$" "\n"
        r"$M_d \dot{x}_2 = J_q^T \tau - C_d x_2 + M_d \omega_n^2 e$" "\n"
        r"$v = \dot{x}_1,\ F_h = M_d \omega_n^2 e$",
        "section 4.2.1",
        ("x", "tau", "omega_n", "k_D"), ("v", "F_hand_observed", "x_observer", "v_observer"),
    ),
)  # fmt: skip


def _observer_parts(block: Block) -> tuple[BlockPart, ...]:
    """The parts of encoders and observer."""
    if "k_D" in block.p:
        return _NICOSIA
    period = ("step_size",) if "step_size" in block.p else ()
    kalman = BlockPart(
        "Kalman observer",
        r"$M_d \dot{v} = J_q^T \tau - C_d v + F_h,\ \dot{x} = v$" "\n"
        r"$e = (J_q^T J_q)^{-1} J_q^T (q - \varphi(x))$" "\n"
        r"$x, v, F_h \mathrel{+}= g_1 e,\ g_2 e,\ M_d g_3 e$",
        "",
        ("q", "tau", "omega_n", *period),
        ("x", "v", "F_hand_observed", "x_observer", "v_observer", "F_observer"),
    )  # fmt: skip
    return replace(_COUNTED, gives=("q",)), kalman


def _twin_part(block: Block) -> BlockPart:
    """The part of the motion."""
    p = block.p
    tau = r"(\tau + \tau_f)" if "motor_friction" in p else r"\tau"
    friction = tuple(name for name, *_ in FRICTION if name in p)
    stops = ("reach_limit", "stop_stiffness", "stop_damping")
    applied = ("tau_applied",) if "tau_applied" in block.x else ()
    return BlockPart(
        "twin pantograph",
        rf"$M_d \dot{{v}} + C_d v = J_q^T {tau}$" "\n" r"$+ F_h + F_{stops}$",
        "(4.5)",
        ("tau", "F_hand", *friction, *stops),
        ("x_true", "v_true", "workspace_margin", *applied),
    )


def haptic_device(device: Device, encoders: bool = False) -> Component:
    """The device, sensed by encoders where `encoders` says so, with the observer of these in it or
    beside it."""
    if not encoders:
        return _ideal(device)
    return _without_observer(device) if device.observer.beside else _with_observer(device)


def _ideal(device: Device) -> Component:
    """The device whose pose and velocity are known."""
    block = Block(
        inputs=[_F_MOTOR, _F_HAND],
        parameters=_parameters(device, (*TORQUE_LIMIT, *STOPS)),
        states=_STATES,
        outputs=[X, V, M, C, *_TRUE_OUTPUTS],
    )
    x, v = block.x["x_true"], block.x["v_true"]
    tau = pantograph.motor_torques(block.u["F_motor"], x, block.p)
    inertia, c = pantograph.motion(x, v, block.p)
    output = {"x": x, "v": v, "M": inertia, "c": c}
    parts = [_MOTORS, _twin_part(block), _IDEAL, _MATRICES]
    return _component(block, "ideally sensed", {}, _motion(block, device, tau), output, parts)


def _with_observer(device: Device) -> Component:
    """The device with encoders and observer."""
    encoders = variables(device, ENCODERS, "fixed")
    block = Block(
        inputs=[_F_MOTOR, _F_HAND],
        parameters=[
            *_parameters(device, (*TORQUE_LIMIT, *STOPS)),
            *encoders,
            *observer_laws.parameters(device),
        ],
        states=[*_STATES, *observer_laws.states(device)],
        outputs=[X, V, F_HAND_OBSERVED, M, C, *_TRUE_OUTPUTS],
    )
    u, p = block.u, block.p
    observer = observer_laws.observer(device, p)
    now = observer.read(block.x)
    output = observer.outputs(now)
    tau = pantograph.motor_torques(u["F_motor"], output["x"], p)
    motion = _motion(block, device, tau)
    first = observer.start(_measured(block, p["x_start"])[0], p["x_start"])
    after = observer.advance(now, _measured(block, motion["x_true"])[0], tau, block.h)
    sensing, observed = "encoders and observer", _observer_parts(block)
    parts = [_MOTORS, _twin_part(block), *observed, _MATRICES]
    return _component(block, sensing, first.states, motion | after.states, output, parts)


def _without_observer(device: Device) -> Component:
    """The device with encoders, whose observer is a block of its own."""
    encoders = variables(device, ENCODERS, "fixed")
    block = Block(
        inputs=[_TAU, _F_HAND],
        parameters=[*_parameters(device, STOPS), *encoders],
        states=[*_STATES, _TAU_APPLIED],
        outputs=[*_MEASURED_OUTPUTS, *_TRUE_OUTPUTS],
    )
    x, tau = block.x, block.u["tau"]
    angles, counts = _measured(block, x["x_true"])
    output = {"q": angles, "counts": counts, "tau_applied": x["tau_applied"]}
    output |= {"q_true": pantograph.base_angles(x["x_true"], block.p)}
    initial = {"tau_applied": ca.SX.zeros(tau.numel())}
    step = _motion(block, device, tau) | {"tau_applied": tau}
    return _component(block, "encoders", initial, step, output, [_twin_part(block), _COUNTED])


def _measured(block: Block, pose: ca.SX) -> tuple[ca.SX, ca.SX]:
    """The base angles at a pose by the encoders (rad), and the counts of these."""
    angles, resolution = pantograph.base_angles(pose, block.p), block.p["encoder_resolution"]
    return count(angles, resolution)


def _motion(block: Block, device: Device, tau: ca.SX) -> dict[str, ca.SX]:
    """The states of the motion after h."""
    motion = advance_device(block, tau, device.substeps)
    return {"x_true": motion[: SPACE.size], "v_true": motion[SPACE.size :]}


def _component(
    block: Block,
    sensing: str,
    initial: Mapping[str, ca.SX],
    step: Mapping[str, ca.SX],
    output: Mapping[str, ca.SX],
    parts: Sequence[BlockPart],
) -> Component:
    """The device with what is the same however it is sensed: its start, and its true motion."""
    x, p = block.x, block.p
    true = {name: x[name] for name in ("x_true", "v_true")}
    true |= {"workspace_margin": ca.mmin(pantograph.margins(x["x_true"], p))}
    at_rest = {"x_true": p["x_start"], "v_true": ca.SX.zeros(SPACE.size)}
    return block.component(
        "haptic_device",
        f"Twin-pantograph haptic device with motors, {sensing}",
        "continuous",
        initial={**at_rest, **initial},
        step=step,
        output={**output, **true},
        documentation=__doc__ or "",
        parts=parts,
    )
