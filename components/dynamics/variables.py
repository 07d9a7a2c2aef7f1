"""Variables of the virtual mechanism, and those that it shares with the virtual environment."""

from __future__ import annotations

from hapticlink.components import forces
from hapticlink.components.component import Variable
from hapticlink.components.linkage.closures import gear_parameters
from hapticlink.components.linkage.model import count_rows
from hapticlink.components.linkage.parameters import body_parameters, mean_link_length
from hapticlink.components.port_space import PortSpace
from hapticlink.components.schematic_parts import BlockPart
from hapticlink.components.specs.linkage import Directions, Linkage, Mechanism, coordinates


def parameters(linkage: Linkage) -> tuple[Variable, ...]:
    """Parameters of the linkage: masses, geometry, and those of its forces."""
    return (*body_parameters(linkage), *gear_parameters(linkage), *forces.parameters(linkage))


def mechanism_parameters(
    linkage: Linkage, mechanism: Mechanism, default_beta: float
) -> list[Variable]:
    """Parameters of the virtual mechanism; Baumgarte's alpha only where the scene gives it, since
    its default depends on the step size."""
    variables = [*parameters(linkage), *start_parameters(linkage)]
    if linkage.closed and mechanism.stabilization == "baumgarte":
        text = "Baumgarte frequency of (3.3)"
        if mechanism.alpha is not None:
            variables.append(Variable("alpha", (), "1/s", mechanism.alpha, text))
        beta = default_beta if mechanism.beta is None else mechanism.beta
        variables.append(Variable("beta", (), "1", beta, "Baumgarte damping ratio of (3.3)"))
    return variables


def start_parameters(linkage: Linkage) -> list[Variable]:
    """Parameters for the start pose before assembly and the start velocity before projection."""
    units = linkage.coordinate_units
    q, qd = (tuple(coordinates(linkage, s)) for s in (linkage.start, linkage.start_velocity))
    n = (len(units),)
    text = "joint rates before assembly; those that the scene gives are kept"
    return [
        Variable("q_start", n, units, q, "joint coordinates before assembly", "fixed"),
        Variable("qd_start", n, linkage.rate_units, qd, text, "fixed"),
    ]


def length_parameter(linkage: Linkage, length: float | None) -> Variable:
    """The parameter L (m); by default the mean link length."""
    length = mean_link_length(linkage) if length is None else length
    return Variable("length_scale", (), "m", length, "L of S = diag(1, 1, L)")


def direction_parameters(directions: Directions) -> list[Variable]:
    """Parameters of the detection of constrained directions: tolerance and hysteresis."""
    tolerance, hysteresis = directions.rank_tolerance, directions.hysteresis
    text = "eigenvalue ratio below which a direction is constrained"
    to_become_free = "factor on rank_tolerance to become free again"
    return [
        Variable("rank_tolerance", (), "1", tolerance, text),
        Variable("hysteresis", (), "1", hysteresis, to_become_free),
    ]


def states(linkage: Linkage) -> list[Variable]:
    units = linkage.coordinate_units
    n = (len(units),)
    return [Variable("q", n, units), Variable("qd", n, linkage.rate_units)]


def motion_outputs(linkage: Linkage) -> list[Variable]:
    units, m, space = linkage.coordinate_units, count_rows(linkage), linkage.space
    changes = tuple(f"{u}/s2" for u in units)
    n, velocity = (len(units),), "velocity of the operational point"
    bias, accelerations = "operational acceleration at zero wrench", "joint accelerations"
    variables = [
        Variable("x", *space.pose, description="pose of the operational point"),
        Variable("v", *space.twist, description=velocity, derivative_of="x"),
        Variable("q", n, units, description="joint coordinates"),
        Variable("qd", n, linkage.rate_units, description="joint rates", derivative_of="q"),
        Variable("qdd", n, changes, 0.0, accelerations, derivative_of="qd", on_request=True),
        Variable("a_bias", *space.acceleration, description=bias, on_request=True),
        Variable("energy", (), "J", description="kinetic and potential energy"),
    ]
    if m:
        text, gap = "Lagrange multipliers of the loops", "largest gap over the loops"
        link = mean_link_length(linkage)  # a loop that is open by a link's length has diverged
        variables.append(Variable("lambda", (m,), "N", description=text, on_request=True))
        variables.append(Variable("closure_error", (), "m", description=gap, max=link))
    return variables


def mobility_output(
    space: PortSpace, prefix: str = "", place: str = "the operational point"
) -> Variable:
    text = f"mobility at {place}"
    return Variable(f"{prefix}Lambda_inv", *space.mobility, description=text, kind="semidefinite")


def direction_outputs(space: PortSpace, user: str = "") -> list[Variable]:
    """P_c and the number of constrained directions at the operational point, or at a user's."""
    prefix, at = (f"{user}.", f" at {user}") if user else ("", "")
    text = f"projector on the constrained directions{at}, scaled by L"
    return [
        Variable(f"{prefix}P_c", *space.projector, description=text, kind="projector"),
        Variable(f"{prefix}n_constraints", description=f"number of constrained directions{at}"),
    ]


def operational_point(gives: tuple[str, ...]) -> BlockPart:
    """The transformation T from joint coordinates to the operational point."""
    law = r"$x = r_h(q),\ v = J_h \dot{q}$"
    return BlockPart("operational point (T)", law, "(2.16), fig. 4.4", ("q", "qd"), gives)


def mobility_part(gives: tuple[str, ...], reads: tuple[str, ...] = ("q",)) -> BlockPart:
    """Lambda^-1 at the operational point and at further ones."""
    law = r"$\Lambda^{-1} = J_h D^{-1} (J_h^T - W^T$" "\n" r"$(W D^{-1} W^T)^{-1} W D^{-1} J_h^T)$"
    return BlockPart("mobility", law, "(B.13)", reads, gives)


def directions_part(reads: tuple[str, ...], gives: tuple[str, ...]) -> BlockPart:
    """The constrained directions of a mobility."""
    law = r"$P_c$: projector on null$(S \Lambda^{-1} S)$"
    gains = ("length_scale", "rank_tolerance", "hysteresis")
    return BlockPart("constrained directions", law, "in place of (B.14)", (*reads, *gains), gives)
