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
from hapticlink.components.port_space import PLANE, Entries
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

SPACE = PLANE
"""Of the port at the handle."""
_F = Variable("F", *SPACE.wrench, description="wrench of the hand on the handle")
_X = Variable("x", *SPACE.pose, description="pose of the handle")
_V = Variable("v", *SPACE.twist, description="velocity of the handle")


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
    parameters = []
    inputs = [grasp.CLUTCH] if clutch else []
    if isinstance(spec, ConstantHand):
        parameters += [Variable("wrench", *SPACE.wrench, spec.wrench, "wrench on the handle")]
    if spec.damping is not None:
        inputs += [_V]
        parameters += [Variable("damping", *SPACE.damping, spec.damping, "damping to ground")]
    block, signals = Block(inputs=inputs, parameters=parameters, outputs=[_F]), list[TimeSignal]()
    if isinstance(spec, ConstantHand):
        F, kind = block.p["wrench"], "a constant wrench"
    else:
        signals = [signal(spec.table, spec.interpolation, "hand.table")]
        F, kind = signals[0].value(block.t), "a wrench over time"
    if spec.damping is not None:
        F = F - block.p["damping"] * block.u["v"]
    F = grasp.while_held(block.u, rendered.mask(F))
    return _hand(block, kind, "sampled", F, signals)


def _arm(spec: ArmHand, rendered: RenderedDirections) -> Component:
    """M_a x_a'' = K_a (x_t - x_a) + B_a (x_t' - x_a') - F, with the grip's
    F = K_gr (x_a - x) + B_gr (x_a' - v), in the directions in which it acts."""
    block = Block(
        inputs=[_X, _V],
        parameters=[
            Variable("mass", *SPACE.mass, spec.mass, "mass of the arm"),
            Variable("stiffness", *SPACE.stiffness, spec.stiffness, "arm to target path"),
            Variable("damping", *SPACE.damping, spec.damping, "arm to target path"),
            Variable("grip_stiffness", *SPACE.stiffness, spec.grip_stiffness, "arm to handle"),
            Variable("grip_damping", *SPACE.damping, spec.grip_damping, "arm to handle"),
        ],
        states=[
            Variable("x_arm", *_of(rendered, SPACE.pose), description="pose of the arm"),
            Variable("v_arm", *_of(rendered, SPACE.twist), description="velocity of the arm"),
            *_turns(rendered),
        ],
        outputs=[_F],
    )
    x, u, t = block.x, block.u, block.t
    p = {name: rendered.pick_diagonal(block.p[name]) for name in block.p}
    pick = rendered.pick
    signals = [signal(spec.target, spec.interpolation, "hand.target")]
    over = ca.SX.sym("over", time_signals.size_over(signals))
    target, target_rate = ca.vertsplit(time_signals.within(signals, over, t), SPACE.size)
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
    kind = "an arm behind a grip"
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
    return target + 2 * ca.pi * x[TURNS] * ca.vertcat(ca.SX(SPACE.size - 1, 1), 1)


def _spring(spec: SpringHand, rendered: RenderedDirections) -> Component:
    """F = K (x_t - x) + B (x_t' - v)."""
    damped = spec.damping is not None
    parameters = [Variable("stiffness", *SPACE.stiffness, spec.stiffness, "to target path")]
    if spec.damping is not None:
        parameters.append(Variable("damping", *SPACE.damping, spec.damping, "to target path"))
    still = spec.target[0][1:] if isinstance(spec.target, tuple) and len(spec.target) == 1 else None
    if still:
        parameters.append(Variable("target", *SPACE.pose, still, "pose that the spring pulls to"))
    block = Block(
        inputs=[_X, _V] if damped else [_X],
        parameters=parameters,
        states=_turns(rendered),
        outputs=[_F],
    )
    signals = [] if still else [signal(spec.target, spec.interpolation, "hand.target")]
    if still:
        target = first = block.p["target"]
        rate = ca.SX(SPACE.size, 1)
    else:
        target, rate = ca.vertsplit(signals[0].at(block.t), SPACE.size)
        first = signals[0].value(ca.SX(0))
    F = block.p["stiffness"] * SPACE.difference(_turned(target, block.x), block.u["x"])
    if damped:
        F += block.p["damping"] * (rate - block.u["v"])
    initial = _first_turns(rendered, block.u["x"], first)
    kept = {name: block.x[name] for name in block.x}
    F, kind = rendered.mask(F), "a spring to a target path"
    return _hand(block, kind, spec.timing, F, signals, initial=initial, step=kept)


def _fingertip(spec: FingertipHand) -> ArmHand:
    """The arm that a fingertip is: a finger behind its pulp, with forces alone."""

    def of_lengths(value: float) -> tuple[float, float, float]:
        return value, value, 0.0

    return ArmHand(
        mass=(spec.mass, spec.mass, 1.0),
        stiffness=of_lengths(spec.stiffness),
        damping=of_lengths(spec.damping),
        grip_stiffness=of_lengths(spec.pulp_stiffness),
        grip_damping=of_lengths(spec.pulp_damping),
        target=spec.target,
        interpolation=spec.interpolation,
        timing=spec.timing,
    )


def hand(spec: Hand, *, clutch: bool = False, handle: Handle | None = None) -> Component:
    """The hand that `spec` describes. clutch: it lets go of the points of a mechanism (grasp.py),
    and then its wrench is 0; an arm and a spring keep the handle. handle: of a device on which it
    acts in some directions alone: F is without what the device's bearings take."""
    rendered = rendered_directions(handle)
    if isinstance(spec, FingertipHand):
        point = rendered_directions(Handle(body="", angle="free"))
        return _arm(_fingertip(spec), point if rendered.has_moments else rendered)
    if isinstance(spec, ArmHand):
        return _arm(spec, rendered)
    if isinstance(spec, SpringHand):
        return _spring(spec, rendered)
    return _wrench(spec, clutch, rendered)
