"""Assembly of a consistent start pose and start velocity.

    q_{k+1} = q_k - W' (W W')^-1 h(q_k)               Newton steps of least norm
    qd_{k+1} = qd_k - Z W' (W Z W')^-1 W qd_k         Z = diag(0 where a rate is given, else 1)

Rates given by the scene are kept and the others follow from the loops; those that the loops leave
free change as little as possible. The number of steps is fixed, so that an FMU can assemble again
in initialisation mode after its geometry has changed. Where W loses rank the step is that of the
regularised system.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.component import Component, Signals
from hapticlink.components.dynamics.closed_loop_solver import ClosedLoopSolver, UnitInertia
from hapticlink.components.dynamics.variables import parameters, start_parameters
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Linkage, coordinates

STEPS = 12
RATE_STEPS = 3  # each step reduces the error by a factor of about MU
MU = 1e-9  # as in closed_loop_solver.py
TOLERANCE = 1e-9  # for the gap at the start pose (m), and for given rates relative to the largest
LOST = 1e-7  # singular values of W below this share of the largest are none
OFF = 1e-6  # the share of w that no acceleration can take up from which on rates are off a branch
TRIALS, NAMED = 40, 3  # to find the rates along branches, and how many are named


class AssemblyError(ValueError):
    """A loop that cannot be closed from the scene's start pose, or start velocities that are not
    consistent with the loops."""


def assemble(model: LinkageModel) -> tuple[ca.SX, ca.SX]:
    """Expressions of q and qd with h = 0 and W qd = 0: q by least-norm steps from the model's own,
    qd with the rates of `start_velocity`, or the nearest ones if these are not consistent."""
    q, qd = model.q, model.qd
    if not model.linkage.closed:
        return model.shortened(q, qd)
    n = q.numel()
    symbolic = LinkageModel.symbolic(model.linkage, model.p)
    symbols, count = (symbolic.q, symbolic.qd), symbolic.rows
    least = ClosedLoopSolver(UnitInertia(n), symbolic.W, count, MU)
    parameters = model.p.vector
    shared = {"cse": True}
    newton = ca.Function(
        "newton", [symbols[0], parameters], [symbols[0] - least.constrain(symbolic.h)], shared
    )

    def projected(solver: ClosedLoopSolver) -> ca.Function:
        rates = symbols[1] - solver.constrain(symbolic.W @ symbols[1])
        return ca.Function("project", [*symbols, parameters], [rates], shared)

    for _ in range(STEPS):
        q = newton(q, parameters)
    solvers = [least]
    if model.linkage.start_velocity:
        Z = ca.diag(ca.SX(1.0 - given_rates(model.linkage)))
        solvers = [ClosedLoopSolver(UnitInertia(n), ca.sparsify(symbolic.W @ Z), count, MU), least]
    for project in map(projected, solvers):
        for _ in range(RATE_STEPS):
            qd = project(q, qd, parameters)
    return model.shortened(q, qd)


def start_coordinates(linkage: Linkage) -> NDArray[np.float64]:
    """The joint coordinates (m, rad) of the assembled start pose, (n,)."""
    p = Signals("p", [*parameters(linkage), *start_parameters(linkage)])
    q, _ = assemble(LinkageModel(linkage, p, p["q_start"], p["qd_start"]))
    return np.array(ca.Function("start", [p.vector], [q])(p.starts)).ravel()


def given_rates(linkage: Linkage) -> NDArray[np.bool_]:
    """Whether `start_velocity` gives the rate of each coordinate, (n,)."""
    named = {j.name: (1.0,) * j.kind.size for j in linkage.joint}
    given = {name: value for name, value in named.items() if name in linkage.start_velocity}
    return np.array(coordinates(linkage, given), dtype=bool)


def require_assembled(component: Component, model: LinkageModel) -> None:
    """Raises AssemblyError for a loop that does not close from the default start pose, for given
    start rates that are not consistent, with the nearest rates that are, and for rates along no
    branch of the motion where W loses rank, with some that are."""
    n = model.q.numel()
    start = component.initialize(component.start_inputs, component.start_parameters)
    q, qd = start[:n], np.array(start[n : 2 * n]).ravel()
    none = ca.SX(0, 1)
    gaps = ca.vertcat(none, *(ca.norm_2(closure.h) for closure in model.closures))
    fixed = ca.vertcat(none, *(ca.norm_2(ca.vertcat(c.constant, 0)) for c in model.closures))
    gap_function = ca.Function("gaps", [model.q, model.p.vector], [gaps, fixed])
    left_open, constant = (
        np.array(gap).ravel() for gap in gap_function(q, component.start_parameters)
    )
    for closure, left, never in zip(model.closures, left_open, constant, strict=True):
        if not never < TOLERANCE:
            raise AssemblyError(
                f"loop `{closure.name}` ({closure.joins}) can never close: no coordinate moves "
                f"{closure.constant.numel()} of its rows, and {never:.3g} m are left; check its "
                "points and axes"
            )
        if not left < TOLERANCE:
            raise AssemblyError(
                f"loop `{closure.name}` ({closure.joins}) does not close: "
                f"{left:.3g} m are left from the start pose given; "
                "check the lengths, or start nearer to a closed pose"
            )
    wanted = np.array(coordinates(model.linkage, model.linkage.start_velocity))
    largest = np.abs([*wanted, *qd]).max(initial=0.0)
    if (np.abs(qd - wanted) > TOLERANCE * largest)[given_rates(model.linkage)].any():
        raise AssemblyError(
            f"`linkage.start_velocity` gives {', '.join(_rates(model.linkage, wanted))}, and the "
            "loops do not allow these rates together: leave out those that follow from others, or "
            f"give what is nearest, {', '.join(_rates(model.linkage, qd))}"
        )

    if qd.any():
        _require_branch(component, model, np.array(q).ravel(), qd)


def _require_branch(
    component: Component, model: LinkageModel, q: NDArray[np.float64], qd: NDArray[np.float64]
) -> None:
    """Raises AssemblyError for start rates at which the loops do not stay closed in second order.

    W qdd = -w(qd) has no solution where N' w(qd) != 0 for the left null vectors N of W. These are
    there where W is redundant, and then N' w = 0 for all rates with W qd = 0, or where branches of
    the motion meet, along which alone it is 0 (Mueller, J. Mech. Robotics 10, 2018).
    """
    if not model.closures:
        return
    p = component.start_parameters
    arguments = [model.q, model.qd, model.p.vector]
    w_function = ca.Function("w", arguments, [model.rate(model.W @ model.qd)])
    W_function = ca.Function("W", [model.q, model.p.vector], [model.W])
    left, sizes, right = np.linalg.svd(np.array(W_function(q, p)))
    rank = int(np.sum(sizes > LOST * sizes[0]))
    N, Z = left[:, rank:], right[rank:].T

    def w(rates: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array(w_function(q, rates, p)).ravel()

    scale = float(np.linalg.norm(w(qd)) + sizes[0] * (qd @ qd))
    if not np.linalg.norm(N.T @ w(qd)) > OFF * scale:
        return
    found = _branches(lambda rates: N.T @ w(rates), Z, model.linkage)
    names = [j.name for j in model.linkage.joint]
    said = [f"{{ {', '.join(_rates(model.linkage, rates, names))} }}" for rates in found]
    remedy = f"give the rates of one, linkage.start_velocity = {' or '.join(said)}; or " * bool(
        said
    )
    raise AssemblyError(
        "at the start pose branches of the motion meet, where W loses rank (as where all links are "
        f"in line), and {', '.join(_rates(model.linkage, qd, names))}, which "
        "`linkage.start_velocity` leads to, is along none of them: the loops would open; "
        f"{remedy}start beside this pose"
    )


def _branches(
    bent: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    Z: NDArray[np.float64],
    linkage: Linkage,
) -> list[NDArray[np.float64]]:
    """Some rates Z c, with those that the scene gives, at which bent(Z c) = 0, quadratic in c, by
    Newton's method from several c; the smallest ones first."""
    given = given_rates(linkage)
    wanted = np.array(coordinates(linkage, linkage.start_velocity))[given]

    def residual(c: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate([bent(Z @ c), (Z @ c)[given] - wanted])

    k, size = Z.shape[1], np.abs(wanted).max(initial=0.0) or 1.0
    found: list[NDArray[np.float64]] = []
    for c in size * np.random.default_rng(0).normal(size=(TRIALS, k)):
        for _ in range(TRIALS):
            columns = [(residual(c + d) - residual(c - d)) / 2 for d in size * np.eye(k)]
            J = np.array(columns).T / size  # exact: the residual is quadratic
            c = c - np.linalg.lstsq(J, residual(c))[0]
        rates = Z @ c
        if np.abs(residual(c)).max() > TOLERANCE * size or not np.isfinite(rates).all():
            continue
        rates[np.abs(rates) < TOLERANCE * np.abs(rates).max()] = 0.0
        if rates.any() and not any(np.allclose(rates, known, atol=1e-6 * size) for known in found):
            found.append(rates)
    return sorted(found, key=lambda rates: float(rates @ rates))[:NAMED]


def _rates(
    linkage: Linkage, qd: NDArray[np.float64], names: Collection[str] | None = None
) -> Iterator[str]:
    """`crank = 2` for each joint of `names`, by default those that `start_velocity` names."""
    place = 0
    for j in linkage.joint:
        rates = qd[place : place + j.kind.size].tolist()
        place += len(rates)
        if j.name in (linkage.start_velocity if names is None else names):
            value = f"{rates[0]:.10g}" if len(rates) == 1 else str(rates)
            yield f"{j.name} = {value}"
