"""A virtual wall: a sampled spring and damper on the coordinate of a device (section 1.3.2).

    p_k = x_k - x_w            x_k: measured position, in whole quanta if there are any
    F_k = -K p_k - B v_k       v_k: measured velocity, or (x_k - x_{k-1})/T

A unilateral wall fills x > x_w: F = 0 where p <= 0, and it never pulls (F <= 0).
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import STEP_SIZE, Block, Component, Variable


def virtual_wall(
    stiffness: float,
    damping: float | None,
    *,
    position: float,
    quantum: float | None,
    unilateral: bool,
    measured_velocity: bool,
    step_s: float = 1e-3,
) -> Component:
    """The FMU `virtual_wall`, sampled: F of t_k from the inputs at t_k.

    stiffness: K (N/m). damping: B (N.s/m), None without a damper. position: x_w (m). quantum: of
    the encoder (m), whose reading is rounded down to a whole number of them; None reads x exactly,
    and so does the parameter 0. The backward difference starts with v = 0; its T is the parameter
    `step_size`, which starts at step_s (s).
    """
    differenced = damping is not None and not measured_velocity
    inputs = [Variable("x", (), "m", description="position of the device")]
    if damping is not None and measured_velocity:
        inputs += [Variable("v", (), "m/s", description="velocity of the device")]
    parameters = [
        Variable("stiffness", (), "N/m", stiffness, "K"),
        Variable("position", (), "m", position, "x_w"),
    ]
    if damping is not None:
        parameters += [Variable("damping", (), "N.s/m", damping, "B")]
    if quantum is not None:
        parameters += [Variable("quantum", (), "m", quantum, "resolution of the encoder")]
    if differenced:
        parameters += [Variable(STEP_SIZE, (), "s", step_s, "T of the difference", "fixed")]
    block = Block(
        inputs=inputs,
        parameters=parameters,
        states=[Variable("x_last", (), "m")] if differenced else [],
        outputs=[Variable("F", (), "N", description="force of the wall on the device")],
    )
    u, p = block.u, block.p
    x = _reading(u["x"], p["quantum"]) if quantum is not None else u["x"]
    F = -p["stiffness"] * (x - p["position"])
    if differenced:
        F -= p["damping"] * (x - block.x["x_last"]) / p[STEP_SIZE]
    elif damping is not None:
        F -= p["damping"] * u["v"]
    if unilateral:
        F = ca.if_else(x > p["position"], ca.fmin(F, 0.0), 0.0)
    return block.component(
        "virtual_wall",
        "A virtual wall: a sampled spring and damper",
        "sampled",
        initial={"x_last": x} if differenced else {},
        step={"x_last": x} if differenced else {},
        output={"F": F},
        documentation=__doc__ or "",
    )


def _reading(x: ca.SX, quantum: ca.SX) -> ca.SX:
    """x rounded down to a whole number of quanta; x itself where the quantum is 0."""
    coarse = quantum > 0.0
    return ca.if_else(coarse, quantum * ca.floor(x / ca.if_else(coarse, quantum, 1.0)), x)
