"""The virtual mechanism: the linkage's own dynamics, at the rate of the haptic loop.

    D qdd + C qd = Q + J_h' (F_hand - F_drift) + W' lambda,   W qdd + w_stab = 0   (B.6)
    w_stab = w + 2 alpha beta W qd + alpha^2 h                                  (B.5) as corrected

Closures are kept by the stabilisation that the scene names: none, Baumgarte, or projection of
position and velocity after each step. The start pose is assembled in initialisation.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components import integrators, resisted
from hapticlink.components.assembly import assemble, require_closed
from hapticlink.components.component import (
    ACCELERATION,
    MOBILITY,
    POSE,
    TWIST,
    WRENCH,
    Block,
    Component,
    Variable,
)
from hapticlink.components.linkage import (
    LinkageModel,
    coordinate_units,
    coordinates,
    mean_link_length,
    parameters,
)
from hapticlink.components.operational_space import OperationalSpace
from hapticlink.components.projection import project
from hapticlink.components.specs import Directions, Linkage, Mechanism


def virtual_mechanism(
    linkage: Linkage,
    mechanism: Mechanism,
    directions: Directions | None = None,
    *,
    step_s: float,
) -> Component:
    """The FMU `virtual_mechanism`. With `directions` it puts out its own Lambda_inv and P_c.

    step_s (s), the communication step, sets the default Baumgarte alpha. Raises AssemblyError
    where a loop does not close, ValueError for an unknown method.
    """
    n, m = len(coordinate_units(linkage)), 2 * len(linkage.loop)
    method = integrators.METHODS.get(mechanism.integrator)
    if method is None:
        known = sorted(integrators.METHODS)
        raise ValueError(f"`integrator`: {mechanism.integrator!r} is unknown; take one of {known}")
    block = Block(
        inputs=(
            Variable("F_hand", (3,), WRENCH, description="wrench of the hand"),
            Variable("F_drift", (3,), WRENCH, description="drift wrench; acts here as -"),
        ),
        parameters=_parameters(linkage, mechanism, method, step_s / mechanism.substeps, directions),
        states=_states(linkage, directions),
        outputs=_outputs(linkage, m, directions),
    )
    model = LinkageModel(linkage, block.p, block.x["q"], block.x["qd"], block.t)
    space = OperationalSpace(model)
    F = block.u["F_hand"] - block.u["F_drift"]
    qdd, multipliers = space.motion(F)

    q0, qd0 = assemble(LinkageModel(linkage, block.p, block.p["q_start"], block.p["qd_start"]))
    initial = {"q": q0, "qd": qd0}
    output = {
        "x": model.x_h,
        "v": model.v_h,
        "q": model.q,
        "qd": model.qd,
        "qdd": qdd,
        "a_bias": space.a_bias,
        "energy": model.energy,
    }
    if m:
        output |= {"lambda": multipliers, "closure_error": model.closure_error}

    stepped = _step(block, model, mechanism, F, space)
    if directions:
        S = resisted.scaling(block.p["length_scale"])
        scaled = ca.Function("scaled", [model.q, block.p.vector], [S @ space.Lambda_inv @ S])
        resistance = (block.p["rank_tolerance"], block.p["hysteresis"])
        after, _ = resisted.eigen(scaled(stepped[:n], block.p.vector))
        count = resisted.count(after, block.x["n_resisted"], *resistance)
        stepped = ca.vertcat(stepped[: 2 * n], count)
        first, _ = resisted.eigen(scaled(q0, block.p.vector))
        initial["n_resisted"] = resisted.count(first, ca.SX(0), *resistance)
        values, vectors = resisted.eigen(scaled(model.q, block.p.vector))
        output |= {
            "Lambda_inv": space.Lambda_inv,
            "P_c": resisted.projector(values, vectors, block.x["n_resisted"]),
            "n_constraints": block.x["n_resisted"],
        }
    component = block.component(
        "virtual_mechanism",
        "The linkage's own dynamics under the hand's and the drift wrench",
        "continuous",
        initial=initial,
        step=stepped,
        output=output,
        substeps=mechanism.substeps,
        documentation=__doc__ or "",
    )
    require_closed(component, model)
    return component


def _parameters(
    linkage: Linkage,
    mechanism: Mechanism,
    method: integrators.Integrator,
    step_s: float,
    directions: Directions | None,
) -> list[Variable]:
    found = [*parameters(linkage), *start_parameters(linkage)]
    if linkage.loop and mechanism.stabilization == "baumgarte":
        default = method.baumgarte
        alpha = default.alpha_h / step_s if mechanism.alpha is None else mechanism.alpha
        beta = default.beta if mechanism.beta is None else mechanism.beta
        found.append(Variable("alpha", (), "1/s", alpha, "Baumgarte frequency of (3.3)"))
        found.append(Variable("beta", (), "1", beta, "Baumgarte damping ratio of (3.3)"))
    if directions:
        found += direction_parameters(linkage, directions)
    return found


def start_parameters(linkage: Linkage) -> list[Variable]:
    """Start pose before assembly, and start velocity before its projection."""
    units = coordinate_units(linkage)
    rates = tuple(f"{u}/s" for u in units)
    q, qd = (tuple(coordinates(linkage, s)) for s in (linkage.start, linkage.start_velocity))
    n = (len(units),)
    return [
        Variable("q_start", n, units, q, "joint coordinates before assembly", "fixed"),
        Variable("qd_start", n, rates, qd, "joint rates before projection", "fixed"),
    ]


def direction_parameters(linkage: Linkage, directions: Directions) -> list[Variable]:
    """Length scale, tolerance and hysteresis of the test for resisted directions."""
    length = directions.length_scale or mean_link_length(linkage)
    return [
        Variable("length_scale", (), "m", length, "L of S = diag(1, 1, L)"),
        Variable("rank_tolerance", (), "1", directions.rank_tolerance, "share that counts as none"),
        Variable("hysteresis", (), "1", directions.hysteresis, "factor to leave a direction free"),
    ]


def _states(linkage: Linkage, directions: Directions | None) -> list[Variable]:
    units = coordinate_units(linkage)
    n = (len(units),)
    found = [Variable("q", n, units), Variable("qd", n, tuple(f"{u}/s" for u in units))]
    return [*found, Variable("n_resisted")] if directions else found


def _outputs(linkage: Linkage, m: int, directions: Directions | None) -> list[Variable]:
    units = coordinate_units(linkage)
    n = (len(units),)
    found = [
        Variable("x", (3,), POSE, description="pose of the operational point"),
        Variable("v", (3,), TWIST, description="its velocity"),
        Variable("q", n, units, description="joint coordinates"),
        Variable("qd", n, tuple(f"{u}/s" for u in units), description="joint rates"),
        Variable("qdd", n, tuple(f"{u}/s2" for u in units), description="joint accelerations"),
        Variable("a_bias", (3,), ACCELERATION, description="operational acceleration at no wrench"),
        Variable("energy", (), "J", description="kinetic and potential energy"),
    ]
    if m:
        found.append(Variable("lambda", (m,), "N", description="Lagrange multipliers of the loops"))
        found.append(Variable("closure_error", (), "m", description="largest gap over the loops"))
    return found + (direction_outputs() if directions else [])


def direction_outputs() -> list[Variable]:
    return [
        Variable("Lambda_inv", (3, 3), MOBILITY, description="mobility at the operational point"),
        Variable("P_c", (3, 3), "1", description="projector on the resisted directions, scaled"),
        Variable("n_constraints", (), "1", description="number of resisted directions"),
    ]


def _step(
    block: Block, model: LinkageModel, mechanism: Mechanism, F: ca.SX, space: OperationalSpace
) -> ca.SX:
    """(q, qd) after h: the method on the stabilised equations, then projection if chosen."""
    n = model.q.numel()
    closing = -model.w
    if model.linkage.loop and mechanism.stabilization == "baumgarte":
        alpha, beta = block.p["alpha"], block.p["beta"]
        closing -= 2 * alpha * beta * (model.W @ model.qd) + alpha**2 * model.h
    qdd, _ = space.solver.solve(model.Q + model.J_h.T @ F - model.C_qd, closing)
    x = ca.vertcat(model.q, model.qd)
    ode = ca.Function(
        "ode", [x, block.u.vector, block.p.vector, block.t], [ca.vertcat(model.qd, qdd)]
    )
    after = integrators.step(
        mechanism.integrator, ode, x, block.u.vector, block.p.vector, block.t, block.h, range(n)
    )
    if mechanism.stabilization == "projection":
        after = ca.vertcat(*project(model, after[:n], after[n:]))
    return after
