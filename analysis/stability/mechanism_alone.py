"""The mechanism by itself: without hand and rendering, under the wrenches that hold it at rest.

    x' = A x over a step of length H,   sigma + i omega = ln(z)/H

x is the state of the mechanism's FMU at the equilibrium, and z an eigenvalue of A, the slopes of
its doStep with all inputs held. What grows there is no fault of rates, holds or gains: a pendulum
upside down, a link that its motor turns on.
"""

from __future__ import annotations

import numpy as np

from hapticlink.analysis.stability.linear_period import LinearPeriod
from hapticlink.analysis.stability.modes import Bounds, kind
from hapticlink.orchestrator.base.signal_names import MECHANISM
from hapticlink.orchestrator.plan.operations import Step


def growth_alone(period: LinearPeriod, bounds: Bounds) -> float:
    """The growth rate (1/s) of the fastest mode of the mechanism by itself; 0 where none grows by
    more than a drift, or the scene has no mechanism."""
    inputs = {s.name for c in period.map_.system.into(MECHANISM) for s in c.inputs}
    state = [
        int(row)
        for c, row in zip(period.map_.coordinates, period.order, strict=True)
        if c.kind == "fmu" and c.owner == MECHANISM and c.variable not in inputs and not c.inert
    ]
    steps = [act for act, source in period.sources.items() if source == (Step, MECHANISM)]
    if not (state and steps):
        return 0.0
    step, index = steps[0], {row: i for i, row in enumerate(state)}
    into, of = ([i for i, r in enumerate(rows) if r in index] for rows in (step.into, step.of))
    written, read = ([index[r] for r in rows] for rows in (step.into[into], step.of[of]))
    A = np.eye(len(state))
    A[written] = 0.0
    A[np.ix_(written, read)] = step.J[np.ix_(into, of)]
    H = period.map_.period / period.map_.count(Step, MECHANISM)
    s = np.log(np.linalg.eigvals(A).astype(complex) + 1e-300) / H
    felt = (
        float(x.real)
        for x in s
        if x.real > 0.0 and kind(x.real, abs(x.imag) / (2 * np.pi), bounds) != "drift"
    )
    return max(felt, default=0.0)
