"""Time-domain passivity observer and controller at the motors' port.

Hannaford, Ryu, IEEE Trans. Robotics and Automation 18 (2002), 1, for an impedance display, with the
sums of Ryu, Kim, Hannaford, IEEE Trans. Robotics 20 (2004), 365: a wrench F_j that is held over a
tick is paired with the displacement of that tick, so that the energy is that of any motion between
samples. At t_k, after x_k is read,

    E_k   = E_{k-1} - F_{k-1} . (x_k - x_{k-1}),   E_0 = the budget      (observer)
    F_k   = F_r - beta/T M v_k,   v_k = (x_k - x_{k-1})/T                 (controller)
    beta  = min(-E_k/(v_k' M v_k), limit)  where E_k < 0 and v_k' M v_k/2 > noise, else 0

F_r is the wrench of the rendering and M the device's inertia, by which translations and rotations
count alike: the damping takes beta v'M v in a tick, and brakes all directions in the same ratio. A
sampled damper B on a mass m is stable for B < 2 m/T only, which is beta < 2; `limit` is below that.
What a tick cannot take stays in E for the next ones.

Reset: where F_r has been zero for a time, what the rendering has absorbed is forgotten, E back to
the budget; a deficit is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from hapticlink.components.component import Signals, Variable
from hapticlink.components.port_space import PortSpace
from hapticlink.components.ports import STEP_SIZE
from hapticlink.components.schematic_parts import BlockPart
from hapticlink.components.specs.control import PassivityLaw

PERIOD = Variable(STEP_SIZE, (), "s", 1e-3, "period T", "fixed")


def parameters(spec: PassivityLaw) -> list[Variable]:
    """The budget, the limit, the noise, and the time after which a free handle is a new start."""
    variables = [
        Variable("passivity_energy", (), "J", spec.energy, "energy that the motors may give"),
        Variable("passivity_limit", (), "1", spec.limit, "largest beta, below 2"),
        Variable("passivity_noise", (), "J", spec.noise, "kinetic energy without a direction"),
    ]
    if spec.reset_after is not None:
        text = "time without a wrench after which what was absorbed is forgotten"
        variables.append(Variable("passivity_reset_after", (), "s", spec.reset_after, text))
    return variables


def states(spec: PassivityLaw, space: PortSpace) -> list[Variable]:
    """The observer's memory, of a port."""
    variables = [
        Variable("E_before", (), "J", description="energy left at the last sample"),
        Variable("x_before", *space.pose, description="pose at the last sample"),
        Variable("F_before", *space.wrench, description="wrench of the last sample"),
    ]
    if spec.reset_after is not None:
        variables.append(Variable("free_time", (), "s", description="time without a wrench"))
    return variables


OUTPUTS = (
    Variable("passivity_energy_left", (), "J", description="E, what the motors may still give"),
    Variable("passivity_damping", (), "1/s", description="beta/T of the passivity controller"),
)


def part(
    spec: PassivityLaw, space: PortSpace, reads: tuple[str, str, str], gives: str
) -> BlockPart:
    """The part that reads rendered wrench, pose and inertia, and gives F, by their names."""
    given = tuple(v.name for v in (*states(spec, space), *OUTPUTS))
    gains = tuple(v.name for v in parameters(spec))
    law = r"$F = u - \frac{\beta}{T} M \frac{\Delta x}{T}$"
    source = "Hannaford, Ryu 2002"
    return BlockPart("passivity controller", law, source, (*reads, *gains), (gives, *given))


@dataclass(frozen=True)
class Passive:
    """The wrench F_k, and by name the states at the start and after the step, and the outputs."""

    wrench: ca.SX
    initial: dict[str, ca.SX]
    step: dict[str, ca.SX]
    output: dict[str, ca.SX]


def passive(rendered: ca.SX, x: ca.SX, M: ca.SX, state: Signals, p: Signals) -> Passive:
    """F_k of the rendered wrench F_r (n,) at the pose x (n,), for the inertia M (n, n)."""
    T = p[STEP_SIZE]
    moved = x - state["x_before"]
    left = state["E_before"] - ca.dot(state["F_before"], moved)
    step: dict[str, ca.SX] = {}
    none = ca.SX.zeros(x.shape[0])
    initial = {"E_before": p["passivity_energy"], "x_before": x, "F_before": none}
    if "passivity_reset_after" in p:
        free = ca.if_else(ca.dot(rendered, rendered) > 0.0, 0.0, state["free_time"] + T)
        is_reset = free >= p["passivity_reset_after"]
        left = ca.if_else(is_reset, ca.fmin(left, p["passivity_energy"]), left)
        initial["free_time"], step["free_time"] = ca.SX(0), free
    momentum = M @ moved / T
    twice = ca.dot(moved, momentum) / T
    acts = ca.logic_and(left < 0.0, twice > 2.0 * p["passivity_noise"])
    needed = -left / ca.if_else(acts, twice, 1.0)
    beta = ca.if_else(acts, ca.fmin(needed, p["passivity_limit"]), 0.0)
    wrench = rendered - beta / T * momentum
    step |= {"E_before": left, "x_before": x, "F_before": wrench}
    output = {"passivity_energy_left": left, "passivity_damping": beta / T}
    return Passive(wrench, initial, step, output)
