"""The scalar variables of an FMU, as its model description has them, and the arrays they form.

Value references count scalars from 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from itertools import groupby

import casadi as ca

from hapticlink.components.component import Component, Variable
from hapticlink.fmus.errors import FmuError


@dataclass(frozen=True)
class ScalarVariable:
    """A variable of FMI 2.0, or an entry of an array of FMI 3.0."""

    kind: str
    """INPUT, PARAMETER or OUTPUT."""
    name: str
    unit: str
    """"" for none."""
    description: str
    _: KW_ONLY
    start: float | None = None
    fixed: bool = False
    """A parameter that is set before the run only."""
    max: float | None = None
    sampled: bool = False
    """Of an output: changes at the steps of its block only."""
    derivative_of: str | None = None
    """The output of which it is the time derivative."""
    depends: tuple[str, ...] = ()
    """The inputs that an output depends on at a communication point."""
    shape: tuple[int, ...] = ()
    """That of the vector or matrix of which it is an entry."""

    @property
    def causality(self) -> str:
        return self.kind.lower()

    @property
    def attributes(self) -> dict[str, str]:
        """Causality, variability and, where it has to be said, how it starts; its description."""
        varies = {"variability": "continuous"}
        if self.kind == "PARAMETER":
            varies = {"variability": "fixed" if self.fixed else "tunable", "initial": "exact"}
        elif self.start is None:
            kind = "discrete" if self.sampled else "continuous"
            varies = {"variability": kind, "initial": "calculated"}
        described = {"description": self.description} if self.description else {}
        return described | {"causality": self.causality} | varies


def scalar_variables(component: Component) -> list[ScalarVariable]:
    """Those of a component: [inputs | parameters | outputs] in flat order. Raises FmuError for a
    declared derivative that is not of the shape of its output."""
    settable = [*_scalars("INPUT", component.inputs), *_scalars("PARAMETER", component.parameters)]
    bases, sampled = _bases(component), component.timing == "sampled"
    outputs = [
        replace(
            v,
            start=None,
            sampled=sampled,
            derivative_of=bases.get(v.name),
            depends=tuple(settable[i].name for i in columns),
        )
        for v, columns in zip(
            _scalars("OUTPUT", component.outputs), find_feed_through(component), strict=True
        )
    ]
    return settable + outputs


def _scalars(kind: str, variables: Iterable[Variable]) -> Iterator[ScalarVariable]:
    for v in variables:
        for name, unit, start in zip(v.names, v.units, v.starts, strict=True):
            fixed = v.variability == "fixed"
            yield ScalarVariable(
                kind, name, unit, v.description, start=start, fixed=fixed, max=v.max, shape=v.shape
            )


def _bases(component: Component) -> dict[str, str]:
    """By name of an output, that of which it is the time derivative."""
    outputs, bases = {v.name: v for v in component.outputs}, dict[str, str]()
    for v in (v for v in component.outputs if v.derivative_of):
        of = outputs.get(v.derivative_of or "")
        if of is None or of.shape != v.shape:
            raise FmuError(
                f"`{component.name}`: `{v.name}` is declared the derivative of "
                f"`{v.derivative_of}`, which is no output of its shape"
            )
        bases |= zip(v.names, of.names, strict=True)
    return bases


def find_feed_through(component: Component) -> list[list[int]]:
    """For each flat output, the flat inputs that y = output(x, u, p, t) depends on."""
    return _rows(component.output.jac_sparsity(0, 1))


def initial_dependencies(component: Component) -> list[list[int]]:
    """For each flat output, the indices in [inputs | parameters] that it depends on at t = 0."""
    n_u, n_p = len(component.start_inputs), len(component.start_parameters)
    known, t = ca.SX.sym("known", n_u + n_p), ca.SX.sym("t")
    u, p = known[:n_u], known[n_u:]
    y = component.output(component.initialize(u, p), u, p, t)
    return _rows(ca.Function("initial", [known, t], [y]).jac_sparsity(0, 0))


def _rows(sparsity: ca.Sparsity) -> list[list[int]]:
    rows: list[list[int]] = [[] for _ in range(sparsity.size1())]
    for row, column in zip(*sparsity.get_triplet(), strict=True):
        rows[row].append(column)
    return [sorted(columns) for columns in rows]


@dataclass(frozen=True)
class ArrayVariable:
    """A variable of FMI 3.0, whose entries are scalars, row by row."""

    name: str
    shape: tuple[int, ...]
    reference: int
    """That of the first entry."""
    entries: tuple[ScalarVariable, ...]


def arrays(variables: Sequence[ScalarVariable]) -> Iterator[ArrayVariable]:
    """The scalars as variables of FMI 3.0: vectors and matrices whole, but for those of which not
    all entries are there."""
    reference = 0
    for (_, name), group in groupby(variables, key=lambda v: (v.kind, v.name.partition("[")[0])):
        entries = tuple(group)
        shape = entries[0].shape
        if shape and math.prod(shape) == len(entries):
            yield ArrayVariable(name, shape, reference, entries)
        else:
            for i, variable in enumerate(entries, reference):
                yield ArrayVariable(variable.name, (), i, (variable,))
        reference += len(entries)
