"""Variables of the virtual mechanism, and those that it shares with the virtual environment."""

from __future__ import annotations

from hapticlink.components import forces
from hapticlink.components.component import ACCELERATION, MOBILITY, POSE, TWIST, Variable
from hapticlink.components.linkage.closures import gear_parameters, rows
from hapticlink.components.linkage.parameters import (
    body_parameters,
    coordinate_units,
    coordinates,
    mean_link_length,
)
from hapticlink.components.specs.linkage import Directions, Linkage, Mechanism


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
    units = coordinate_units(linkage)
    rates = tuple(f"{u}/s" for u in units)
    q, qd = (tuple(coordinates(linkage, s)) for s in (linkage.start, linkage.start_velocity))
    n = (len(units),)
    return [
        Variable("q_start", n, units, q, "joint coordinates before assembly", "fixed"),
        Variable(
            "qd_start",
            n,
            rates,
            qd,
            "joint rates before assembly; those that the scene gives are kept",
            "fixed",
        ),
    ]


def length_parameter(linkage: Linkage, length: float | None) -> Variable:
    """The parameter L (m); by default the mean link length."""
    length = mean_link_length(linkage) if length is None else length
    return Variable("length_scale", (), "m", length, "L of S = diag(1, 1, L)")


def direction_parameters(directions: Directions) -> list[Variable]:
    """Parameters of the detection of constrained directions: tolerance and hysteresis."""
    return [
        Variable(
            "rank_tolerance",
            (),
            "1",
            directions.rank_tolerance,
            "eigenvalue ratio below which a direction is constrained",
        ),
        Variable(
            "hysteresis",
            (),
            "1",
            directions.hysteresis,
            "factor on rank_tolerance to become free again",
        ),
    ]


def states(linkage: Linkage) -> list[Variable]:
    units = coordinate_units(linkage)
    n = (len(units),)
    return [Variable("q", n, units), Variable("qd", n, tuple(f"{u}/s" for u in units))]


def motion_outputs(linkage: Linkage) -> list[Variable]:
    units, m = coordinate_units(linkage), sum(rows(linkage))
    n = (len(units),)
    variables = [
        Variable("x", (3,), POSE, description="pose of the operational point"),
        Variable(
            "v", (3,), TWIST, description="velocity of the operational point", derivative_of="x"
        ),
        Variable("q", n, units, description="joint coordinates"),
        Variable(
            "qd",
            n,
            tuple(f"{u}/s" for u in units),
            description="joint rates",
            derivative_of="q",
        ),
        Variable(
            "qdd",
            n,
            tuple(f"{u}/s2" for u in units),
            description="joint accelerations",
            derivative_of="qd",
        ),
        Variable(
            "a_bias", (3,), ACCELERATION, description="operational acceleration at zero wrench"
        ),
        Variable("energy", (), "J", description="kinetic and potential energy"),
    ]
    if m:
        variables.append(
            Variable("lambda", (m,), "N", description="Lagrange multipliers of the loops")
        )
        gap = "largest gap over the loops"
        apart = mean_link_length(linkage)  # a loop that is open by a link's length has diverged
        variables.append(Variable("closure_error", (), "m", description=gap, max=apart))
    return variables


def mobility_output() -> Variable:
    text = "mobility at the operational point"
    return Variable("Lambda_inv", (3, 3), MOBILITY, description=text, kind="semidefinite")


def direction_outputs() -> list[Variable]:
    text = "projector on the constrained directions, scaled by L"
    return [
        Variable("P_c", (3, 3), "1", description=text, kind="projector"),
        Variable("n_constraints", (), "1", description="number of constrained directions"),
    ]
