"""The exact slopes of a doStep and of a get of our FMUs: from the graph that a Python FMU carries,
or that of the component from which a native one was generated.

With trial states x_0 = x, x_{k+1} = f(x_k, u, p, t_k, h), k < n substeps (fmus/fmu_functions.py),

    dx_{k+1}/d(x, u) = f_x dx_k/d(x, u) + (0, f_u)

The outputs y of a plant are those at the end of the step, y = g(x_n, u, p, t + H), those of a
sampled block those at its beginning, y = g(x, u, p, t). f_x, f_u, g_x and g_u are the Jacobians of
the functions that the FMU runs, by CasADi's algorithmic differentiation.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np

from hapticlink.fmus.blocks import component
from hapticlink.fmus.fmu_functions import functions_of_fmu
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.scene.blocks import blocks
from hapticlink.orchestrator.scene.scene import Scene

FUNCTIONS, ABOUT = "resources/functions.casadi.json", "resources/component.json"
KEPT = 32
"""Graphs that a process keeps, as many as FMUs."""
_GENERATED: dict[str, GraphSlopes] = {}
"""By the GUID of a native FMU, a hash of its content: those of the component that it is made of."""


def graph_slopes(found: Description, fmu: str, scene: Scene | None) -> GraphSlopes | None:
    """Those of an FMU of `scene`; None for FMUs of others, and for native ones that are no block of
    the scene."""
    if not found.block:
        return None
    if carried := _read_graph(found.path, found.guid):
        return carried
    if generated := _GENERATED.get(found.guid):
        return generated
    block = next((b for b in blocks(scene).built if b.name == fmu), None) if scene else None
    if block is None:
        return None
    made = component(block.block, block.settings)
    functions = {f.name(): f for f in functions_of_fmu(made).functions}
    if len(_GENERATED) == KEPT:
        _GENERATED.clear()
    _GENERATED[found.guid] = GraphSlopes(functions, made.timing == "sampled", made.substeps)
    return _GENERATED[found.guid]


@lru_cache(KEPT)
def _read_graph(path: Path, guid: str) -> GraphSlopes | None:
    with zipfile.ZipFile(path) as archive:
        if FUNCTIONS not in archive.namelist():
            return None
        texts, about = (json.loads(archive.read(name)) for name in (FUNCTIONS, ABOUT))
    texts.pop("initialize", "")
    return _deserialize(tuple(texts.items()), about["timing"] == "sampled", about["substeps"])


@lru_cache(KEPT)
def _deserialize(texts: tuple[tuple[str, str], ...], sampled: bool, substeps: int) -> GraphSlopes:
    """Once for all FMUs of the same functions."""
    functions = {name: ca.Function.deserialize(text) for name, text in texts}
    return GraphSlopes(functions, sampled, substeps)


class GraphSlopes:
    """The map and the slopes of an FMU with these `functions`, of what it keeps: inputs u, outputs
    y, states x. `before` is its serialised state, which ends with (time, u, p, y, x); `own` are
    numbers (u, y, x) in its place, a row for each point, the first of which has the slopes."""

    def __init__(self, functions: dict[str, ca.Function], sampled: bool, substeps: int) -> None:
        advance, output = functions["advance"], functions["output"]
        x, u, p, t, h, end, _ = advance.sx_in()
        y, shared = output(x, u, p, t)
        after, y_end, _ = advance(x, u, p, t, h, end, shared)
        kept = ca.SX.sym("y", y.numel())
        self._sampled, self._others, before = sampled, substeps - 1, ca.vertcat(u, kept, x)
        self._n = [s.numel() for s in (t, u, p, y, x)]
        self._advance = _map_with_jacobian([before, p, t, h, end], ca.vertcat(u, y_end, after))
        got = before if sampled else ca.vertcat(u, y, x)
        self._output = _map_with_jacobian([before, p, t], got)
        if self._others:
            further = ca.vertcat(u, kept, functions["substep"](x, u, p, t, h))
            self._substep = _map_with_jacobian([before, p, t, h, end], further)

    @property
    def n_u(self) -> int:
        return self._n[1]

    def step(self, before: Vector, own: Matrix, seconds: float) -> tuple[Matrix, Matrix]:
        """The numbers after a doStep over so many seconds, and d(u, y, x after)/d(u, y, x)."""
        (time,), _, p, *_ = self._parts(before)
        n, J = self._others + 1, np.eye(own.shape[1])
        for k in range(n):
            whole = k == (0 if self._sampled else n - 1)
            when = time + k * (seconds / n), seconds / n, time + seconds
            own, slopes = _at(self._advance if whole else self._substep, own, p, *when)
            J = slopes @ J if k else slopes
        return own, J

    def get(self, before: Vector, own: Matrix) -> tuple[Matrix, Matrix]:
        """As `step`, of reading all outputs, which a plant evaluates anew."""
        (time,), _, p, *_ = self._parts(before)
        return _at(self._output, own, p, time)

    def _parts(self, state: Vector) -> list[Vector]:
        return np.split(state[-sum(self._n) :], np.cumsum(self._n)[:-1])


class _Buffered:
    """A function of CasADi that is evaluated in place: a plain call takes longer to convert its
    numbers than to compute with them."""

    def __init__(self, function: ca.Function) -> None:
        self._arguments = [np.zeros(function.numel_in(i)) for i in range(function.n_in())]
        self._result = np.zeros(function.size_out(0), order="F")
        buffer: Any
        buffer, self._evaluate = function.buffer()
        for i, argument in enumerate(self._arguments):
            buffer.set_arg(i, argument.data)
        buffer.set_res(0, self._result.ravel(order="K").data)
        self._buffer = buffer  # `evaluate` holds a bare pointer to it

    def set_others(self, others: Sequence[Vector | float]) -> None:
        """Sets all arguments but the first."""
        for argument, value in zip(self._arguments[1:], others, strict=True):
            argument[:] = value

    def at(self, own: Vector) -> Matrix:
        """The result, with this first argument."""
        self._arguments[0][:] = own
        self._evaluate()
        return self._result.copy()


_Mapped = tuple[_Buffered, _Buffered]
_IN_PLACE = Lock()
"""Numbers of one evaluation at a time: threads that judge at once share graphs."""


def _map_with_jacobian(arguments: list[ca.SX], result: ca.SX) -> _Mapped:
    """A function, and its Jacobian by the first argument."""
    slopes = ca.densify(ca.jacobian(result, arguments[0]))
    values = ca.Function("values", arguments, [ca.densify(result)])
    return _Buffered(values), _Buffered(ca.Function("slopes", arguments, [slopes]))


def _at(mapped: _Mapped, own: Matrix, *others: Vector | float) -> tuple[Matrix, Matrix]:
    """The results at the rows of `own`, and the Jacobian at the first one."""
    values, slopes = mapped
    with _IN_PLACE:
        for function in mapped:
            function.set_others(others)
        return np.array([values.at(each)[:, 0] for each in own]), slopes.at(own[0])
