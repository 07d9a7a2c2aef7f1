"""Assembly of a start pose: Newton steps of least norm on the loop closures.

    q_{k+1} = q_k - W' (W W')^-1 h(q_k)

The number of steps is fixed, so that an FMU can assemble again, with changed geometry, in
initialisation mode. Where W loses rank the step is that of the regularised system.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import Component
from hapticlink.components.dynamics.closed_loop_solver import ClosedLoopSolver, UnitInertia
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import loop_name

STEPS = 12
MU = 1e-9  # as in closure.py
TOLERANCE = 1e-9  # of the start pose's gap, m


class AssemblyError(ValueError):
    """A loop that does not close from the start pose that the scene gives."""


def assemble(model: LinkageModel) -> tuple[ca.SX, ca.SX]:
    """(q, qd) closest to the model's own that satisfy h = 0 and W qd = 0, as expressions."""
    q, qd = model.q, model.qd
    if not model.linkage.loop:
        return q, qd
    n = q.numel()
    symbols = ca.SX.sym("q", n), ca.SX.sym("qd", n)
    at = LinkageModel(model.linkage, model.p, *symbols)
    least = ClosedLoopSolver(UnitInertia(n), at.W, MU)
    parameters = model.p.vector
    shared = {"cse": True}
    newton = ca.Function(
        "newton", [symbols[0], parameters], [symbols[0] - least.constrain(at.h)], shared
    )
    project = ca.Function(
        "project", [*symbols, parameters], [symbols[1] - least.constrain(at.W @ symbols[1])], shared
    )
    for _ in range(STEPS):
        q = newton(q, parameters)
    return q, project(q, qd, parameters)


def require_closed(component: Component, model: LinkageModel) -> None:
    """Raises AssemblyError naming each loop that stays open from the default start pose."""
    start = component.initialize(component.start_inputs, component.start_parameters)
    n = model.q.numel()
    gaps = ca.Function("h", [model.q, model.p.vector], [model.h])(
        start[:n], component.start_parameters
    )
    for i, loop in enumerate(model.linkage.loop):
        left = float(ca.norm_2(gaps[2 * i : 2 * i + 2]))
        if not left < TOLERANCE:
            name = loop_name(model.linkage, i)
            raise AssemblyError(
                f"loop `{name}` ({loop.bodies[0]} to {loop.bodies[1]}) does not close: "
                f"{left:.3g} m are left from the start pose given; "
                "check the lengths, or start nearer to a closed pose"
            )
