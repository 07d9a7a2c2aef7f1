"""The functions that an FMU runs: those of its component, with a step and its outputs in one pass.

    x_0          = initialize(u, p)
    y, z         = output(x, u, p, t)
    x_1          = substep(x, u, p, t, h)
    x_1, y, z_1  = advance(x, u, p, t, h, end, z)

`advance` is the last substep of a plant and its outputs at the end of the step, or the first
substep of a sampled block and its outputs at the beginning; common subexpressions of both are
evaluated once. z, for plants that take one substep, are the values that depend on x, p and t alone
and that the next step needs: kinematics and factorisations that the outputs have evaluated already.
`substep` is for the other substeps.

Expressions are composed without CasADi's simplifications, which would replace (a + b) - b by a:
every operation is one of the component's, so that the results are the same, bit for bit.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import casadi as ca

from hapticlink.components.component import Component

_SHARED = {"cse": True}


@dataclass(frozen=True)
class OnePass:
    """The functions, with the names of the roles; `substep` is not called if there is only one."""

    initialize: ca.Function
    output: ca.Function
    substep: ca.Function
    advance: ca.Function
    substeps: int

    @property
    def n_shared(self) -> int:
        """The number of values that `advance` and `output` hand to the next step, z."""
        return int(self.output.numel_out(1))

    @property
    def functions(self) -> tuple[ca.Function, ...]:
        """Those that are called."""
        several = (self.substep,) if self.substeps > 1 else ()
        return (self.initialize, self.output, *several, self.advance)


def one_pass(component: Component) -> OnePass:
    with _without_simplification():
        return _compose(component)


GRAPHS = threading.RLock()
"""Held by the thread that derives equations: `_unsimplified` sets an option of the whole process,
under which another thread would derive other graphs."""


@contextmanager
def _without_simplification() -> Iterator[None]:
    with GRAPHS:
        before = ca.GlobalOptions.getSimplificationOnTheFly()
        ca.GlobalOptions.setSimplificationOnTheFly(False)
        try:
            yield
        finally:
            ca.GlobalOptions.setSimplificationOnTheFly(before)


def _compose(component: Component) -> OnePass:
    x, u, p, t, h = component.step.sx_in()
    end, z = ca.SX.sym("end"), ca.SX(0, 1)
    known, given = ca.SX(0, 1), ca.SX.sym("z", 0)
    x1 = component.step(x, u, p, t, h)
    if component.timing == "sampled":
        y = component.output(x, u, p, t)
    else:
        if component.substeps == 1:
            x1, given, known = _without_known(x1, ca.vertcat(x, p, t))
        y = component.output(x1, u, p, end)
    share = ca.Function("share", [x, p, t], [known])
    if known.numel():
        z = share(x1, p, end)
    advance = ca.Function(
        "advance",
        [x, u, p, t, h, end, given],
        [x1, y, z],
        ["x", "u", "p", "t", "h", "end", "z"],
        ["x1", "y", "z1"],
        _SHARED,
    )
    output = ca.Function(
        "output",
        [x, u, p, t],
        [component.output(x, u, p, t), known],
        ["x", "u", "p", "t"],
        ["y", "z"],
        _SHARED,
    )
    substep = component.substep or component.step
    plain = ca.Function("substep", [x, u, p, t, h], [substep(x, u, p, t, h)])
    return OnePass(component.initialize, output, plain, advance, component.substeps)


def _without_known(x1: ca.SX, state: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """x1 in terms of z, z, and the values of z, which depend on `state` alone."""
    rest, symbols, values = ca.extract_parametric(x1, state)
    none = ca.SX(0, 1)
    return ca.densify(rest), ca.vertcat(none, *symbols), ca.vertcat(none, *values)
