"""The functions that an FMU runs: those of its component, with a step and its outputs in one pass.

    x_0          = initialize(u, p)
    y, z         = output(x, u, p, t)
    x_1          = substep(x, u, p, t, h)
    x_1, y, z_1  = advance(x, u, p, t, h, end, z)
    x_1, y, z_1  = reduced(x, u, p, t, h, end, z)

`advance` is the last substep of a plant and its outputs at the end of the step, or the first
substep of a sampled block and its outputs at the beginning; common subexpressions of both are
evaluated once. z, for plants that take one substep, are the values that depend on x, p and t alone
and that the next step needs: kinematics and factorisations that the outputs have evaluated already.
`substep` is for the other substeps. `reduced` is `advance` with 0 for the outputs of a plant that
are evaluated on request (`Variable.on_request`), where this leaves out enough: an FMU takes it
while nobody reads these, and evaluates `output` when somebody does.

Expressions are composed without CasADi's simplifications, which would replace (a + b) - b by a:
every operation is one of the component's, so that the results are the same, bit for bit.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from hapticlink.components.component import Component
from hapticlink.fmus.sine_cosine import with_own_sines

_SHARED = {"cse": True}
RARELY = 4
"""Steps without a read of the outputs on request after which an FMU leaves these out: so many save
more than evaluating all outputs costs once."""
WORTH, LONGEST = 0.05, 30_000
"""Share of the operations of a step that a reduced one leaves out, so that it is worth its size in
the FMU, and the operations above which it would take too long to compile."""


@dataclass(frozen=True)
class OnePass:
    """The functions, with the names of the roles; `substep` is not called if there is only one."""

    initialize: ca.Function
    output: ca.Function
    substep: ca.Function
    advance: ca.Function
    reduced: ca.Function | None
    substeps: int

    @property
    def n_shared(self) -> int:
        """The number of values that `advance` and `output` hand to the next step, z."""
        return int(self.output.numel_out(1))

    @property
    def functions(self) -> tuple[ca.Function, ...]:
        """Those that are called."""
        several = (self.substep,) if self.substeps > 1 else ()
        fewer = (self.reduced,) if self.reduced else ()
        return (self.initialize, self.output, *several, self.advance, *fewer)


def one_pass(component: Component) -> OnePass:
    with _without_simplification():
        return _compose(component)


def functions_of_fmu(component: Component) -> OnePass:
    """Those of `one_pass` with sines and cosines of their own: what an FMU contains, in every
    packaging."""
    parts = one_pass(component)
    with _without_simplification():
        own: dict[str, Any] = {
            role: with_own_sines(f) for role, f in vars(parts).items() if isinstance(f, ca.Function)
        }
        return replace(parts, **own)


GRAPHS = threading.RLock()
"""Held by the thread that derives equations: `_without_simplification` sets an option of the whole
process, under which another thread would derive other graphs."""


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
    reduced = _reduced(component, advance)
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
    return OnePass(component.initialize, output, plain, advance, reduced, component.substeps)


def on_request(component: Component) -> list[bool]:
    """Of each entry of y, whether it is evaluated on request."""
    return [v.on_request for v in component.outputs for _ in range(v.size)]


def _reduced(component: Component, advance: ca.Function) -> ca.Function | None:
    """`reduced`, None where it would not leave out enough."""
    left_out, most = on_request(component), advance.n_instructions()
    if component.timing == "sampled" or not any(left_out) or most > LONGEST:
        return None
    arguments = advance.sx_in()
    x1, y, z1 = advance(*arguments)
    y = ca.vertcat(*(ca.SX(0) if out else y[i] for i, out in enumerate(left_out)))
    names = advance.name_in(), advance.name_out()
    reduced = ca.Function("reduced", arguments, [x1, ca.densify(y), z1], *names, _SHARED)
    return reduced if reduced.n_instructions() <= (1 - WORTH) * most else None


def _without_known(x1: ca.SX, state: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """x1 in terms of z, z, and the values of z, which depend on `state` alone."""
    rest, symbols, values = ca.extract_parametric(x1, state)
    none = ca.SX(0, 1)
    return ca.densify(rest), ca.vertcat(none, *symbols), ca.vertcat(none, *values)
