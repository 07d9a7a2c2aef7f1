"""Nonlinearities that a linearisation cannot follow, and what becomes of each.

Quantisation and Coulomb friction are taken out: their slope is 0, or that of a joint that sticks,
whatever the loop does. So are passivity controllers, and the friction of the hold `passive`, which
act by what has been: without it that hold is `zoh`, but beside `pspm`, whose tank it draws on.
Switches stay as they are at the equilibrium. The hold `reaction` is what it is next to rest, where
it finds no stiffness of a hand: `half-lead`.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import replace

from hapticlink.analysis.stability.state_vector import StateEntry
from hapticlink.orchestrator.base.signal_names import CONTROLLER, DEVICE, MECHANISM, MOTOR_MAP
from hapticlink.orchestrator.fmi.variables import Scalar
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold, array
from hapticlink.orchestrator.system.system import Connection, Fmu, System

NEXT_TO_NOTHING = 1e-18
"""Of friction (N, N.m), which sets a stiffness by a quotient and so must not be 0."""
TAKEN_OUT, AS_AT_REST = "taken out", "as at the equilibrium"
NEXT_TO_REST = "as half-lead, its law for motions far below 10 um in a step: larger ones may decay"
"""What becomes of a nonlinearity, at the end of its line."""
COUNT = "fmu", "n_constrained"
DISCRETE = {
    COUNT,
    ("fmu", "turns"),
    ("fmu", "deflection"),
    ("fmu", "contact_deflection"),
    ("hold", "beta"),
}
"""States that are a count, or belong to friction that is taken out."""


def without(system: System) -> tuple[System, list[str]]:
    """The system without quantisation, friction and passivity controllers, and a line on each."""
    fmus, lines = [], []
    for fmu in system.fmus:
        starts = []
        for scalar, value, what in _find_removed(system, fmu):
            starts.append((scalar, value))
            lines.append(f"{fmu.name}.{scalar.name}: {what}, {TAKEN_OUT}")
        fmus.append(fmu.starting(tuple(starts)))
    drawing = any(c.hold and HOLDS[c.hold].needs == "spring" for c in system.connections)
    connections = []
    for c in system.connections:
        if has_friction(c):
            lines.append(f"{c.name}: the friction of hold {c.hold}, {TAKEN_OUT}")
            c = c if drawing else replace(c, hold="zoh")
        connections.append(c)
    return replace(system, fmus=tuple(fmus), connections=tuple(connections)), lines


def has_friction(c: Connection) -> bool:
    """Whether its hold has a friction, which is taken out."""
    return c.hold == "passive"


def without_friction(holds: Iterable[CompiledHold]) -> None:
    """Takes the friction beta c out of holds `passive`: beta stays 0."""
    for hold in holds:
        if hold.parts.name == "passive":
            array(hold.account.beta, hold.account.n)[:] = 0.0


def _find_removed(system: System, fmu: Fmu) -> Iterator[tuple[Scalar, float, str]]:
    """Parameters that are set, their values, and what they are."""
    block = system.block(fmu.name)
    for scalar in fmu.description.scalars:
        if scalar.causality != "parameter":
            continue
        if block == DEVICE and scalar.name.partition("[")[0] == "encoder_resolution":
            yield scalar, 0.0, "quantisation of the encoders"
        elif (block, scalar.name) == ("virtual_wall", "quantum"):
            yield scalar, 0.0, "quantisation of the encoder"
        elif block in (CONTROLLER, "virtual_wall") and scalar.name == "passivity_limit":
            yield scalar, 0.0, "the passivity controller"
        elif block == MECHANISM and scalar.name.endswith((".friction", "mu_contact")):
            yield scalar, NEXT_TO_NOTHING, "Coulomb friction"


def describe_switches(system: System) -> list[str]:
    """A line of text on each switch that stays as it is at the equilibrium."""
    lines = []
    for fmu in system.fmus:
        block, description = system.block(fmu.name), fmu.description
        stops = ["the stops"] if block == DEVICE else []
        if block in (DEVICE, MOTOR_MAP) and description.port("torque_limit", "parameter"):
            stops.insert(0, "saturation of the motors")
        if stops:
            lines.append(f"{fmu.name}: {', and '.join(stops)}")
        if block == "virtual_wall":
            lines.append(f"{fmu.name}: contact, if the wall is unilateral")
        if description.equations:
            lines.append(f"{fmu.name}: discrete states of the FMU for model exchange")
        if description.port("contact_gap", "output"):
            lines.append(f"{fmu.name}: which places touch")
        if any(s.port.rpartition(".")[2] == "n_constraints" for s in description.outputs):
            lines.append(f"{fmu.name}: number of constrained directions")
    for c in system.connections:
        if c.hold and HOLDS[c.hold].needs in ("power", "spring") and not has_friction(c):
            lines.append(f"{c.name}: the regime of hold {c.hold}")
    reacting = [c for c in system.connections if c.needs == "reaction"]
    return [
        *(f"{line}, {AS_AT_REST}" for line in lines),
        *(f"{c.name}: hold {c.hold}, {NEXT_TO_REST}" for c in reacting),
    ]


def name_by_end(lines: Sequence[str]) -> str:
    """What lines on nonlinearities are about, each once, by what becomes of it."""
    parts = []
    for end in (TAKEN_OUT, AS_AT_REST, NEXT_TO_REST):
        ours = [line.removesuffix(f", {end}") for line in lines if line.endswith(f", {end}")]
        if what := dict.fromkeys(line.partition(": ")[2] for line in ours):
            parts.append(f"{end}: {', '.join(what)}")
    return "; ".join(parts)


def discrete(coordinate: StateEntry, of: Container[tuple[str, str]] = DISCRETE) -> bool:
    """Whether a coordinate is a switch or belongs to what is taken out."""
    variable = coordinate.variable.partition("[")[0].rpartition(".")[2]  # left.n_constrained
    return (coordinate.kind, variable) in of
