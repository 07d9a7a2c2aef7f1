"""The user's hand: a constant wrench, a wrench over time, an arm behind a grip, or a spring.

Sampled: F(t_k) from the handle's x and v at t_k. An arm or spring may be continuous instead, a
plant with F(t_{k+1}) at the end of its step. F acts with + on the handle.

Constant or over time: F = F(t) - B v; x is no input, and v only where there is damping.

Arm: a mass that a spring and damper pull to a target path; F acts through the spring and damper of
the grip, with the handle's x and v held over each step. It starts at the handle's x and v with
F = 0.

Spring: F = K (x_t - x) + B (x_t' - v), without a mass; a target of one row is the tunable parameter
`target`, with x_t' = 0, which whoever runs the FMU can move.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from hapticlink.components import integrators, time_signals
from hapticlink.components.component import Block, Component, Timing, Variable
from hapticlink.components.dynamics import grasp
from hapticlink.components.paths import signal
from hapticlink.components.port_space import PLANE, PortSpace
from hapticlink.components.specs.hand import ArmHand, ConstantHand, Hand, ProfileHand, SpringHand
from hapticlink.components.time_signals import TimeSignal


def _wrench_output(space: PortSpace) -> Variable:
    return Variable("F", *space.wrench, description="wrench of the hand on the handle")


def _pose(space: PortSpace) -> Variable:
    return Variable("x", *space.pose, description="pose of the handle")


def _velocity(space: PortSpace) -> Variable:
    return Variable("v", *space.twist, description="velocity of the handle")


def _hand(
    block: Block, kind: str, timing: Timing, F: ca.SX, signals: list[TimeSignal], **dynamics: Any
) -> Component:
    """The hand with the output F; dynamics: `initial` and `step` of one that has states."""
    states = {"initial": {}, "step": {}} | dynamics
    return block.component(
        "hand",
        f"Hand: {kind}",
        timing,
        output={"F": F},
        documentation=__doc__ or "",
        signals=signals,
        **states,
    )


def _wrench(spec: ConstantHand | ProfileHand, space: PortSpace, clutch: bool) -> Component:
    """F = F(t) - B v, with a damper to ground if the spec has one; 0 while a hand with a clutch
    holds no point."""
    parameters = []
    inputs = [grasp.CLUTCH] if clutch else []
    if isinstance(spec, ConstantHand):
        parameters += [Variable("wrench", *space.wrench, spec.wrench, "wrench on the handle")]
    if spec.damping is not None:
        inputs += [_velocity(space)]
        parameters += [Variable("damping", *space.damping, spec.damping, "damping to ground")]
    block, signals = (
        Block(inputs=inputs, parameters=parameters, outputs=[_wrench_output(space)]),
        list[TimeSignal](),
    )
    if isinstance(spec, ConstantHand):
        F, kind = block.p["wrench"], "a constant wrench"
    else:
        signals = [signal(spec.table, spec.interpolation, "hand.table")]
        F, kind = signals[0].value(block.t), "a wrench over time"
    if spec.damping is not None:
        F = F - block.p["damping"] * block.u["v"]
    return _hand(block, kind, "sampled", grasp.while_held(block.u, F), signals)


def _arm(spec: ArmHand, space: PortSpace) -> Component:
    """M_a x_a'' = K_a (x_t - x_a) + B_a (x_t' - x_a') - F, with the grip's
    F = K_gr (x_a - x) + B_gr (x_a' - v)."""
    block = Block(
        inputs=[_pose(space), _velocity(space)],
        parameters=[
            Variable("mass", *space.mass, spec.mass, "mass of the arm"),
            Variable("stiffness", *space.stiffness, spec.stiffness, "arm to target path"),
            Variable("damping", *space.damping, spec.damping, "arm to target path"),
            Variable("grip_stiffness", *space.stiffness, spec.grip_stiffness, "arm to handle"),
            Variable("grip_damping", *space.damping, spec.grip_damping, "arm to handle"),
        ],
        states=[
            Variable("x_arm", *space.pose, description="pose of the arm"),
            Variable("v_arm", *space.twist, description="velocity of the arm"),
        ],
        outputs=[_wrench_output(space)],
    )
    x, u, p, t = block.x, block.u, block.p, block.t
    signals = [signal(spec.target, spec.interpolation, "hand.target")]
    over = ca.SX.sym("over", time_signals.size_over(signals))
    target, target_rate = ca.vertsplit(time_signals.within(signals, over, t), space.size)
    F = p["grip_stiffness"] * space.difference(x["x_arm"], u["x"])
    F += p["grip_damping"] * (x["v_arm"] - u["v"])
    pull = p["stiffness"] * space.difference(target, x["x_arm"])
    pull += p["damping"] * (target_rate - x["v_arm"])
    ode = block.ode({"x_arm": x["v_arm"], "v_arm": (pull - F) / p["mass"]}, over)
    given = ca.vertcat(u.vector, time_signals.over(signals, t, block.h))
    initial = {"x_arm": u["x"], "v_arm": u["v"]}
    step = integrators.step("rk4", ode, x.vector, given, p.vector, t, block.h, [0, 1, 2])
    kind = "an arm behind a grip"
    return _hand(block, kind, spec.timing, F, signals, initial=initial, step=step)


def _spring(spec: SpringHand, space: PortSpace) -> Component:
    """F = K (x_t - x) + B (x_t' - v)."""
    damped = spec.damping is not None
    parameters = [Variable("stiffness", *space.stiffness, spec.stiffness, "to target path")]
    if spec.damping is not None:
        parameters.append(Variable("damping", *space.damping, spec.damping, "to target path"))
    still = spec.target[0][1:] if isinstance(spec.target, tuple) and len(spec.target) == 1 else None
    if still:
        parameters.append(Variable("target", *space.pose, still, "pose that the spring pulls to"))
    block = Block(
        inputs=[_pose(space), _velocity(space)][: 1 + damped],
        parameters=parameters,
        outputs=[_wrench_output(space)],
    )
    signals = [] if still else [signal(spec.target, spec.interpolation, "hand.target")]
    if still:
        target, rate = block.p["target"], ca.SX(space.size, 1)
    else:
        target, rate = ca.vertsplit(signals[0].at(block.t), space.size)
    F = block.p["stiffness"] * space.difference(target, block.u["x"])
    if damped:
        F += block.p["damping"] * (rate - block.u["v"])
    return _hand(block, "a spring to a target path", spec.timing, F, signals)


def hand(spec: Hand, space: PortSpace = PLANE, *, clutch: bool = False) -> Component:
    """The hand that `spec` describes, at a port. clutch: it lets go of the points of a mechanism
    (grasp.py), and then its wrench is 0; an arm and a spring keep the handle."""
    if isinstance(spec, ArmHand):
        return _arm(spec, space)
    if isinstance(spec, SpringHand):
        return _spring(spec, space)
    return _wrench(spec, space, clutch)
