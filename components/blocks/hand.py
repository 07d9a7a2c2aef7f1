"""The user's hand: a constant wrench, a wrench over time, an arm behind a grip, or a spring.

Sampled: F(t_k) from the handle's x and v at t_k. An arm or spring may be continuous instead, a
plant with F(t_{k+1}) at the end of its step. F acts with + on the handle.

Constant or over time: F = F(t) - B v; x is no input, and v only where there is damping.

Arm: a mass that a spring and damper pull to a target path; F acts through the spring and damper of
the grip, with the handle's x and v held over each step. It starts at the handle's x and v with
F = 0.

Spring: F = K (x_t - x) + B (x_t' - v), without a mass; a target of one row is the tunable parameter
`target`, with x_t' = 0, which whoever runs the FMU can move.

Fingertip: a finger as an arm, that touches the handle by its pulp in a point: forces, no moment.

The angle of a target is a direction: it begins within half a turn of the handle's.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from hapticlink.components import integrators, time_signals
from hapticlink.components.component import Block, Component, Signals, Timing, Variable
from hapticlink.components.dynamics import grasp
from hapticlink.components.dynamics.rendered_directions import (
    RenderedDirections,
    rendered_directions,
)
from hapticlink.components.paths import signal
from hapticlink.components.port_space import PLANE, Entries, PortSpace
from hapticlink.components.specs.device import Handle
from hapticlink.components.specs.hand import (
    ArmHand,
    ConstantHand,
    FingertipHand,
    Hand,
    ProfileHand,
    SpringHand,
)
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


def _wrench(
    spec: ConstantHand | ProfileHand, clutch: bool, rendered: RenderedDirections
) -> Component:
    """F = F(t) - B v, with a damper to ground if the spec has one; 0 while a hand with a clutch
    holds no point."""
    space, parameters = rendered.space, []
    inputs = [grasp.CLUTCH] if clutch else []
    if isinstance(spec, ConstantHand):
        parameters += [Variable("wrench", *space.wrench, spec.wrench, "wrench on the handle")]
    if spec.damping is not None:
        inputs += [_velocity(space)]
        parameters += [Variable("damping", *space.damping, spec.damping, "damping to ground")]
    block = Block(inputs=inputs, parameters=parameters, outputs=[_wrench_output(space)])
    signals: list[TimeSignal] = []
    if isinstance(spec, ConstantHand):
        F, kind = block.p["wrench"], "a constant wrench"
    else:
        signals = [signal(spec.table, spec.interpolation, "hand.table")]
        F, kind = signals[0].value(block.t), "a wrench over time"
    if spec.damping is not None:
        F = F - block.p["damping"] * block.u["v"]
    F = grasp.while_held(block.u, rendered.mask(F))
    return _hand(block, kind, "sampled", F, signals)


GRIP = {"grip_stiffness": "pulp_stiffness", "grip_damping": "pulp_damping"}
"""What of an arm's grip is the pulp of a finger."""


def _arm(spec: ArmHand | FingertipHand, rendered: RenderedDirections) -> Component:
    """M_a x_a'' = K_a (x_t - x_a) + B_a (x_t' - x_a') - F, with the grip's
    F = K_gr (x_a - x) + B_gr (x_a' - v), in the directions in which it acts."""
    space = rendered.space
    is_finger = isinstance(spec, FingertipHand)
    rows = {
        "mass": (space.mass, "mass of the arm"),
        "stiffness": (space.stiffness, "arm to target path"),
        "damping": (space.damping, "arm to target path"),
        "grip_stiffness": (space.stiffness, "arm to handle"),
        "grip_damping": (space.damping, "arm to handle"),
    }
    parameters = []
    for name, (entries, text) in rows.items():
        own = GRIP.get(name, name) if is_finger else name
        shape, unit = ((), entries.units[0]) if is_finger else entries
        parameters.append(Variable(own, shape, unit, getattr(spec, own), text))
    block = Block(
        inputs=[_pose(space), _velocity(space)],
        parameters=parameters,
        states=[
            Variable("x_arm", *_of(rendered, space.pose), description="pose of the arm"),
            Variable("v_arm", *_of(rendered, space.twist), description="velocity of the arm"),
            *_turns(rendered),
        ],
        outputs=[_wrench_output(space)],
    )
    x, u, t = block.x, block.u, block.t
    given_p = [block.p[v.name] for v in parameters]
    along = given_p if is_finger else [rendered.pick_diagonal(value) for value in given_p]
    p, pick = dict(zip(rows, along, strict=True)), rendered.pick
    signals = [signal(spec.target, spec.interpolation, "hand.target")]
    over = ca.SX.sym("over", time_signals.size_over(signals))
    target, target_rate = ca.vertsplit(time_signals.within(signals, over, t), space.size)
    target = _turned(target, x)
    F = p["grip_stiffness"] * (x["x_arm"] - pick(u["x"]))
    F += p["grip_damping"] * (x["v_arm"] - pick(u["v"]))
    pull = p["stiffness"] * (pick(target) - x["x_arm"])
    pull += p["damping"] * (pick(target_rate) - x["v_arm"])
    still = {v.name: ca.SX(*x[v.name].shape) for v in _turns(rendered)}
    ode = block.ode({"x_arm": x["v_arm"], "v_arm": (pull - F) / p["mass"], **still}, over)
    given = ca.vertcat(u.vector, time_signals.over(signals, t, block.h))
    initial = {"x_arm": pick(u["x"]), "v_arm": pick(u["v"])}
    initial |= _first_turns(rendered, u["x"], signals[0].value(ca.SX(0)))
    k = range(rendered.size)
    step = integrators.step("rk4", ode, x.vector, given, block.p.vector, t, block.h, k)
    kind = "a fingertip" if is_finger else "an arm behind a grip"
    F = rendered.put(F)
    return _hand(block, kind, spec.timing, F, signals, initial=initial, step=step)


TURNS = "turns"
"""The state of a hand that has a target: whole turns by which the angle of that is taken on, so
that it begins within half a turn of the handle's."""


def _of(rendered: RenderedDirections, entries: Entries) -> Entries:
    """The shape and units of a quantity in the directions in which a hand acts."""
    return Entries((rendered.size,), entries.units[: rendered.size])


def _turns(rendered: RenderedDirections) -> list[Variable]:
    return [Variable(TURNS)] if rendered.has_moments else []


def _first_turns(rendered: RenderedDirections, x: ca.SX, target: ca.SX) -> dict[str, ca.SX]:
    apart = (x[-1] - target[-1]) / (2 * ca.pi)
    return {TURNS: ca.floor(apart + 0.5)} if rendered.has_moments else {}


def _turned(target: ca.SX, x: Signals) -> ca.SX:
    """A target's pose with its angle taken on by the whole turns of the state."""
    if TURNS not in x:
        return target
    return target + 2 * ca.pi * x[TURNS] * ca.vertcat(ca.SX(target.numel() - 1, 1), 1)


def _spring(spec: SpringHand, rendered: RenderedDirections) -> Component:
    """F = K (x_t - x) + B (x_t' - v)."""
    space, damped = rendered.space, spec.damping is not None
    parameters = [Variable("stiffness", *space.stiffness, spec.stiffness, "to target path")]
    if spec.damping is not None:
        parameters.append(Variable("damping", *space.damping, spec.damping, "to target path"))
    still = spec.target[0][1:] if isinstance(spec.target, tuple) and len(spec.target) == 1 else None
    if still:
        parameters.append(Variable("target", *space.pose, still, "pose that the spring pulls to"))
    block = Block(
        inputs=[_pose(space), _velocity(space)][: 1 + damped],
        parameters=parameters,
        states=_turns(rendered),
        outputs=[_wrench_output(space)],
    )
    signals = [] if still else [signal(spec.target, spec.interpolation, "hand.target")]
    if still:
        target = first = block.p["target"]
        rate = ca.SX(space.size, 1)
    else:
        target, rate = ca.vertsplit(signals[0].at(block.t), space.size)
        first = signals[0].value(ca.SX(0))
    F = block.p["stiffness"] * space.difference(_turned(target, block.x), block.u["x"])
    if damped:
        F += block.p["damping"] * (rate - block.u["v"])
    initial = _first_turns(rendered, block.u["x"], first)
    kept = {name: block.x[name] for name in block.x}
    F, kind = rendered.mask(F), "a spring to a target path"
    return _hand(block, kind, spec.timing, F, signals, initial=initial, step=kept)


def hand(
    spec: Hand, space: PortSpace = PLANE, *, clutch: bool = False, handle: Handle | None = None
) -> Component:
    """The hand that `spec` describes, at a port. clutch: it lets go of the points of a mechanism
    (grasp.py), and then its wrench is 0; an arm and a spring keep the handle. handle: of a device
    on which it acts in some directions alone: F is without what the device's bearings take."""
    rendered = rendered_directions(handle, space)
    if isinstance(spec, FingertipHand):
        point = rendered_directions(Handle(body="", angle="free"))
        return _arm(spec, point if rendered.has_moments else rendered)
    if isinstance(spec, ArmHand):
        return _arm(spec, rendered)
    if isinstance(spec, SpringHand):
        return _spring(spec, rendered)
    return _wrench(spec, clutch, rendered)
