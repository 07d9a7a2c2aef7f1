"""Components: what every block consists of, declared variables and three functions.

    x_0     = initialize(u, p)
    x_{k+1} = step(x_k, u_k, p, t_k, h)
    y_k     = output(x_k, u_k, p, t_k)

All three are CasADi functions of flat columns, whose entries the `Variable` records describe.
The outputs of a *continuous* block (a plant) are those at the end of its step. A *sampled* block
(a controller, an observer) computes y_k from the inputs at t_k; it is stamped t_k and valid on
[t_k, t_k + h). A *frame* block (the graphics copy) computes from the inputs at t_k, too, and takes
its whole step to do so: y_k is stamped t_k + h, and describes t_k.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Literal

import casadi as ca

from hapticlink.components.ports import Gradient, Kind, Power, SpringPorts
from hapticlink.components.schematic_parts import BlockPart, require_complete
from hapticlink.components.time_signals import LookUp, TimeSignal

Timing = Literal["continuous", "sampled", "frame"]
Variability = Literal["fixed", "tunable"]


@dataclass(frozen=True)
class Variable:
    """A named scalar, vector or matrix signal, stored row by row.

    `starts` and `units` raise ValueError where sizes do not agree.
    """

    name: str
    shape: tuple[int, ...] = ()
    unit: str | tuple[str, ...] = "1"
    """An SI unit in FMI's notation ("m", "N.m", "rad/s", "1/kg"; "1" for none), or one for each
    entry, or for each entry of a row."""
    start: float | tuple[float, ...] = 0.0
    """One value for all entries, or one for each."""
    description: str = ""
    variability: Variability = "tunable"
    """Of parameters."""
    kind: Kind | None = None
    """Of outputs."""
    derivative_of: str | None = None
    """The output of which this output is the time derivative."""
    power: Power | None = None
    """The power port of an input."""
    gradient: Gradient | None = None
    """Of an output that is the gradient of another one."""
    on_request: bool = False
    """Whether a step leaves an output of a plant out while nobody reads it, since it takes many
    operations and often only a record has it."""
    max: float | None = None
    """The magnitude of an output above which the run has diverged, or of `step_size` the longest
    that the equations suit; None without such a bound."""

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    @property
    def starts(self) -> tuple[float, ...]:
        if isinstance(self.start, tuple):
            if len(self.start) != self.size:
                raise ValueError(f"`{self.name}`: {len(self.start)} start values for {self.size}")
            return self.start
        return (float(self.start),) * self.size

    @property
    def units(self) -> tuple[str, ...]:
        """One unit per entry; a tuple with the length of a row is repeated for every row."""
        row = self.unit if isinstance(self.unit, tuple) else (self.unit,)
        if not self.size:
            return ()
        if self.size % len(row):
            raise ValueError(f"`{self.name}`: {len(row)} units do not fit {self.size} entries")
        return row * (self.size // len(row))

    @property
    def names(self) -> tuple[str, ...]:
        """FMI 2 structured names, 1-based: `F`, `x[1]`, `Lambda_inv[2,3]`."""
        if len(self.shape) == 0:
            return (self.name,)
        if len(self.shape) == 1:
            return tuple(f"{self.name}[{i + 1}]" for i in range(self.shape[0]))
        rows, columns = self.shape
        return tuple(f"{self.name}[{i + 1},{j + 1}]" for i in range(rows) for j in range(columns))


class Signals(Mapping[str, ca.SX]):
    """CasADi symbols of a list of variables, by name and as one flat column `vector`, and names for
    expressions of them. Raises ValueError for a name that is declared twice."""

    def __init__(self, prefix: str, variables: Iterable[Variable]) -> None:
        self.variables = tuple(variables)
        self.vector = ca.SX.sym(prefix, sum(v.size for v in self.variables))
        self._by_name: dict[str, ca.SX] = {}
        offset = 0
        for v in self.variables:
            if v.name in self._by_name:
                raise ValueError(f"`{v.name}` is declared twice")
            flat = self.vector[offset : offset + v.size]
            if len(v.shape) == 2:
                flat = ca.reshape(flat, v.shape[1], v.shape[0]).T
            self._by_name[v.name] = flat
            offset += v.size

    @property
    def starts(self) -> list[float]:
        """The start values of all variables, in the order of `vector`."""
        return [value for variable in self.variables for value in variable.starts]

    def define(self, name: str, value: ca.SX) -> None:
        """Gives a name to an expression of these symbols. Raises ValueError for one that is
        taken."""
        if name in self._by_name:
            raise ValueError(f"`{name}` is declared twice")
        self._by_name[name] = value

    def __getitem__(self, name: str) -> ca.SX:
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._by_name)


def pack(variables: Iterable[Variable], values: Mapping[str, ca.SX]) -> ca.SX:
    """The flat column of `values`, in the order and shapes of `variables`.

    Raises ValueError where a name is missing, unknown or of another shape.
    """
    variables = tuple(variables)
    unknown = set(values) - {v.name for v in variables}
    missing = {v.name for v in variables} - set(values)
    if unknown or missing:
        raise ValueError(f"values: missing {sorted(missing)}, unknown {sorted(unknown)}")
    columns = []
    for v in variables:
        value = ca.SX(values[v.name])
        shape = (*v.shape, 1, 1)[:2]
        if value.shape != shape:
            raise ValueError(f"`{v.name}`: value of shape {value.shape}, declared {shape}")
        columns.append(ca.vec(value.T) if len(v.shape) == 2 else ca.vec(value))
    return ca.densify(ca.vertcat(*columns)) if columns else ca.SX(0, 1)


@dataclass(frozen=True)
class Component:
    """A complete block."""

    name: str
    description: str
    timing: Timing
    inputs: tuple[Variable, ...]
    parameters: tuple[Variable, ...]
    states: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    initialize: ca.Function
    """(u, p) -> x_0."""
    step: ca.Function
    """(x_k, u_k, p, t_k, h) -> x_{k+1}, called `substeps` times for each communication step."""
    output: ca.Function
    """(x_k, u_k, p, t_k) -> y_k."""
    substeps: int = 1
    substep: ca.Function | None = None
    """Replaces `step` in all substeps but the last, and leaves discrete memory as it is; None where
    there is no such memory."""
    documentation: str = ""
    springs: tuple[SpringPorts, ...] = ()
    """Spring-dampers whose set positions are inputs."""
    look_ups: tuple[LookUp, ...] = ()
    """The look-ups of tables that the functions call."""
    state_notes: Mapping[str, str] = field(default_factory=dict)
    """By the name of a state: the cause to report if it is not finite."""
    parts: tuple[BlockPart, ...] = ()
    """Those that its schematic shows, in the order of their evaluation; none if it has none."""

    @cached_property
    def state_texts(self) -> tuple[str, ...]:
        """Names of the states, each with the cause to report if it is not finite."""
        names = (name for v in self.states for name in v.names)
        notes = self.state_notes
        return tuple(f"{name} ({notes[name]})" if name in notes else name for name in names)

    @cached_property
    def start_parameters(self) -> tuple[float, ...]:
        return tuple(s for v in self.parameters for s in v.starts)

    @cached_property
    def start_inputs(self) -> tuple[float, ...]:
        return tuple(s for v in self.inputs for s in v.starts)


class Block:
    """The symbols from which the expressions of a block are built; `component` returns the finished
    `Component`."""

    def __init__(
        self,
        *,
        inputs: Iterable[Variable] = (),
        parameters: Iterable[Variable] = (),
        states: Iterable[Variable] = (),
        outputs: Iterable[Variable] = (),
    ) -> None:
        self.u = Signals("u", inputs)
        self.p = Signals("p", parameters)
        self.x = Signals("x", states)
        self.outputs = tuple(outputs)
        self.t = ca.SX.sym("t")
        self.h = ca.SX.sym("h")

    def ode(self, derivative: Mapping[str, ca.SX], further: ca.SX | None = None) -> ca.Function:
        """The function (x, (u, further), p, t) -> dx/dt, for an integrator. Raises ValueError where
        `derivative` does not match the states."""
        xdot = pack(self.x.variables, derivative)
        u = self.u.vector if further is None else ca.vertcat(self.u.vector, further)
        arguments = [self.x.vector, u, self.p.vector, self.t]
        return ca.Function("ode", arguments, [xdot], ["x", "u", "p", "t"], ["xdot"])

    def component(
        self,
        name: str,
        description: str,
        timing: Timing,
        *,
        output: Mapping[str, ca.SX],
        initial: Mapping[str, ca.SX] = MappingProxyType({}),
        step: Mapping[str, ca.SX] | ca.SX = MappingProxyType({}),
        substeps: int = 1,
        memory: Collection[str] = (),
        documentation: str = "",
        state_notes: Mapping[str, str] | None = None,
        springs: Iterable[SpringPorts] = (),
        shared: bool = False,
        signals: Iterable[TimeSignal] = (),
        parts: Iterable[BlockPart] = (),
    ) -> Component:
        """The component with the given expressions: step and output in this block's symbols,
        initial in u and p only; signals are those over time that they read.

        memory: states that change only in the last of several substeps.
        shared: common subexpressions of step and initial have been eliminated already; doing so
        again would take most of the time to build a large graph. Raises ValueError where names or
        shapes do not match the declared variables, and where `parts` are given that do not read and
        give them.
        """
        if parts := [*parts]:
            given = ([v.name for v in of] for of in (self.x.variables, self.outputs))
            require_complete(parts, {*self.u, *self.p, *self.x}, *given)
        x, u, p, *_ = arguments = [self.x.vector, self.u.vector, self.p.vector, self.t, self.h]
        x1 = pack(self.x.variables, step) if isinstance(step, Mapping) else ca.densify(step)
        is_memory = [v.name in memory for v in self.x.variables for _ in range(v.size)]
        without_memory = ca.vertcat(*(x[i] if kept else x1[i] for i, kept in enumerate(is_memory)))
        x0, y = pack(self.x.variables, initial), pack(self.outputs, output)
        once, names = {"cse": not shared}, ["x", "u", "p", "t", "h"]
        return Component(
            name=name,
            description=description,
            timing=timing,
            inputs=self.u.variables,
            parameters=self.p.variables,
            states=self.x.variables,
            outputs=self.outputs,
            initialize=ca.Function("initialize", [u, p], [x0], ["u", "p"], ["x0"], once),
            step=ca.Function("step", arguments, [x1], names, ["x1"], once),
            output=ca.Function("output", arguments[:4], [y], names[:4], ["y"], {"cse": True}),
            substeps=substeps,
            substep=ca.Function("substep", arguments, [without_memory], names, ["x1"], once)
            if substeps > 1 and memory
            else None,
            documentation=documentation,
            state_notes=state_notes or {},
            springs=tuple(springs),
            look_ups=tuple(look_up for s in signals for look_up in s.look_ups),
            parts=tuple(parts),
        )
