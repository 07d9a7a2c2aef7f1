"""A signal over time, from a table or from formulas: what feeds an input that no other FMU feeds.

    y(t_n), held until the next communication point

Sampled; without states.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components import paths
from hapticlink.components.component import Block, Component, Variable
from hapticlink.components.formula import expression
from hapticlink.components.specs.paths import Interpolation
from hapticlink.components.time_signals import Rows, TimeSignal


def signal(
    table: Rows | None,
    interpolation: Interpolation,
    formula: str | tuple[str, ...] | None,
    units: tuple[str, ...],
) -> Component:
    """The FMU `signal`, whose output y is a scalar where there is one value. Raises ValueError
    unless it has either a table or a formula, for what `paths.signal` and `formula.expression`
    refuse, and where there is not one unit for each value."""
    block, read = Block(), list[TimeSignal]()
    if (table is None) == (not formula):
        raise ValueError("give a signal either a `table` or a `formula`")
    if table is None:
        texts = (formula,) if isinstance(formula, str) else formula or ()
        y = ca.vertcat(*(_of_time(text, block.t) for text in texts))
    else:
        read = [paths.signal(table, interpolation, "table")]
        y = read[0].value(block.t)
    size = y.numel()
    if units and len(units) != size:
        raise ValueError(f"{len(units)} `units` for {size} values: give one for each")
    shape = () if size == 1 else (size,)
    block.outputs = (Variable("y", shape, units or "1", description="value of the signal"),)
    return block.component(
        "signal",
        "A signal over time",
        "sampled",
        output={"y": y},
        documentation=__doc__ or "",
        signals=read,
    )


def _of_time(formula: str, t: ca.SX) -> ca.SX:
    try:
        return expression(formula, {"t": t})
    except ValueError as error:
        raise ValueError(f"`formula` {formula[:100]!r}: {error}") from None
