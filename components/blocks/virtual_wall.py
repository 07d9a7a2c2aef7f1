"""A virtual wall: a sampled spring and damper on the coordinate of a device (section 1.3.2).

    p_k = x_k - x_w            x_k: measured position, in whole quanta if there are any
    F_k = -K p_k - B v_k       v_k: measured velocity, or (x_k - x_{k-1})/T

A unilateral wall fills x > x_w: F = 0 where p <= 0, and it never pulls (F <= 0).

A pulse (event-based feedback: Kuchenbecker, Fiene, Niemeyer, IEEE Trans. Visualization and Computer
Graphics 12 (2006), 219) adds, from the first sample inside, at the velocity v_in, and for a time D

    F = -M v_in/D

open loop, on whichever side the device is then. Its impulse M v_in is that of a collision with
M = m (1 + e), which takes a mass m from v_in to -e v_in.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.control import passivity as observer
from hapticlink.components.device.motors_and_encoders import quantised
from hapticlink.components.port_space import LINE
from hapticlink.components.ports import STEP_SIZE
from hapticlink.components.specs.control import PassivityLaw

PERIOD = 1e-3
"""Where `step_size` (s) starts, which a run sets."""


def virtual_wall(
    stiffness: float,
    damping: float | None,
    *,
    position: float,
    quantum: float | None,
    unilateral: bool,
    measured_velocity: bool,
    pulse: tuple[float, float] | None = None,
    passivity: float | None = None,
) -> Component:
    """The FMU `virtual_wall`, sampled: F of t_k from the inputs at t_k.

    stiffness: K (N/m). damping: B (N.s/m), None without a damper. position: x_w (m). quantum: of
    the encoder (m), whose reading is rounded down to a whole number of them; None reads x exactly,
    and so does the parameter 0. pulse: M (kg) and D (s), None without; D is rounded to whole
    periods, at least one. The backward difference starts with v = 0; its T is the parameter
    `step_size`. passivity: m (kg) of the device, with which a passivity controller of default
    settings (control/passivity.py) bounds its damping; None without.
    """
    moved = damping is not None or pulse is not None
    differenced = moved and not measured_velocity
    inputs = [Variable("x", (), "m", description="position of the device")]
    if moved and measured_velocity:
        inputs += [Variable("v", (), "m/s", description="velocity of the device")]
    impulse, duration = pulse or (None, None)
    rows = (
        ("stiffness", "N/m", stiffness, "K"),
        ("position", "m", position, "x_w"),
        ("damping", "N.s/m", damping, "B"),
        ("quantum", "m", quantum, "resolution of the encoder"),
        ("pulse", "kg", impulse, "impulse of a contact by its velocity"),
        ("pulse_duration", "s", duration, "duration of the impulse"),
    )
    parameters = [Variable(n, (), unit, v, text) for n, unit, v, text in rows if v is not None]
    if differenced or pulse is not None or passivity is not None:
        parameters += [Variable(STEP_SIZE, (), "s", PERIOD, "period T", "fixed")]
    states = [Variable("x_last", (), "m")] if differenced else []
    if pulse is not None:
        states += [Variable("inside"), Variable("pulse_force", (), "N"), Variable("samples_left")]
    outputs = [Variable("F", (), "N", description="force of the wall on the device")]
    if passivity is not None:
        text = "m of the device, for its passivity controller"
        parameters += [Variable("mass", (), "kg", passivity, text)]
        parameters += observer.parameters(PassivityLaw())
        states += observer.states(PassivityLaw(), LINE)
        outputs += observer.OUTPUTS
    block = Block(inputs=inputs, parameters=parameters, states=states, outputs=outputs)
    return _component(block, unilateral)


def _component(block: Block, unilateral: bool) -> Component:
    """The block with the parts whose variables it has."""
    u, p = block.u, block.p
    x = quantised(u["x"], p["quantum"]) if "quantum" in p else u["x"]
    v = ca.SX(0)
    if "x_last" in block.x:
        v = (x - block.x["x_last"]) / p[STEP_SIZE]
    elif "v" in u:
        v = u["v"]
    F = -p["stiffness"] * (x - p["position"])
    if "damping" in p:
        F -= p["damping"] * v
    if unilateral:
        F = ca.if_else(x > p["position"], ca.fmin(F, 0.0), 0.0)
    initial: dict[str, ca.SX] = {"x_last": x} if "x_last" in block.x else {}
    after, output = dict(initial), dict[str, ca.SX]()
    if "pulse" in p:
        inside = x > p["position"]
        pulse, states = _pulse(block, inside, v)
        F += pulse
        initial |= {"inside": inside, "pulse_force": ca.SX(0), "samples_left": ca.SX(0)}
        after |= states
    if "mass" in p:
        guarded = observer.passive(F, x, p["mass"], block.x, p)
        F, output = guarded.wrench, guarded.output
        initial, after = initial | guarded.initial, after | guarded.step
    return block.component(
        "virtual_wall",
        "A virtual wall: a sampled spring and damper",
        "sampled",
        initial=initial,
        step=after,
        output={"F": F, **output},
        documentation=__doc__ or "",
    )


def _pulse(block: Block, inside: ca.SX, v: ca.SX) -> tuple[ca.SX, dict[str, ca.SX]]:
    """The force of the pulse (N), and its states at the next sample."""
    p, x = block.p, block.x
    samples = ca.fmax(ca.floor(p["pulse_duration"] / p[STEP_SIZE] + 0.5), 1.0)
    begun = ca.logic_and(inside, ca.logic_not(x["inside"]))
    strength = -p["pulse"] * ca.fmax(v, 0.0) / (samples * p[STEP_SIZE])
    force = ca.if_else(begun, strength, x["pulse_force"])
    left = ca.if_else(begun, samples, x["samples_left"])
    after = ca.fmax(left - 1.0, 0.0)
    states = {"inside": inside, "pulse_force": force, "samples_left": after}
    return ca.if_else(left > 0.0, force, 0.0), states
