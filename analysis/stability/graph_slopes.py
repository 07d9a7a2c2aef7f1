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
from functools import lru_cache
from pathlib import Path

import casadi as ca
import numpy as np

from hapticlink.fmus.blocks import component
from hapticlink.fmus.fmu_functions import one_pass
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
    if carried := _read(found.path, found.guid):
        return carried
    if generated := _GENERATED.get(found.guid):
        return generated
    block = next((b for b in blocks(scene).built if b.name == fmu), None) if scene else None
    if block is None:
        return None
    made = component(block.block, block.settings)
    functions = {f.name(): f for f in one_pass(made).functions}
    if len(_GENERATED) == KEPT:
        _GENERATED.clear()
    _GENERATED[found.guid] = GraphSlopes(functions, made.timing == "sampled", made.substeps)
    return _GENERATED[found.guid]


@lru_cache(KEPT)
def _read(path: Path, guid: str) -> GraphSlopes | None:
    with zipfile.ZipFile(path) as archive:
        if FUNCTIONS not in archive.namelist():
            return None
        texts, about = (json.loads(archive.read(name)) for name in (FUNCTIONS, ABOUT))
    functions = {name: ca.Function.deserialize(text) for name, text in texts.items()}
    return GraphSlopes(functions, about["timing"] == "sampled", about["substeps"])


class GraphSlopes:
    """The slopes of an FMU with these `functions`, of what it keeps: inputs u, outputs y, states x.
    `before` is its serialised state, which ends with (time, u, p, y, x)."""

    def __init__(self, functions: dict[str, ca.Function], sampled: bool, substeps: int) -> None:
        advance, output = functions["advance"], functions["output"]
        x, u, p, t, h, end, _ = advance.sx_in()
        y, shared = output(x, u, p, t)
        after, y_end, _ = advance(x, u, p, t, h, end, shared)
        self._sampled, self._others = sampled, substeps - 1
        self._n = [s.numel() for s in (t, u, p, y, x)]
        self._advance = _jacobian([x, u, p, t, h, end], [after, y_end])
        self._output = None if sampled else _jacobian([x, u, p, t], [y])
        if self._others:
            self._substep = _jacobian([x, u, p, t, h], [functions["substep"](x, u, p, t, h)])

    @property
    def n_u(self) -> int:
        return self._n[1]

    def step(self, before: Vector, seconds: float) -> Matrix:
        """d(u, y, x after)/d(u, y, x before) of a doStep over so many seconds."""
        (time,), u, p, y, x = self._parts(before)
        end, n = float(time) + seconds, self._others + 1
        size, J = seconds / n, np.eye(len(x), len(x) + len(u))  # dx/d(x, u)
        of_u = np.eye(len(u), len(x) + len(u), len(x))
        dy = np.zeros((len(y), len(x) + len(u)))
        for k in range(n):
            if whole := k == (0 if self._sampled else n - 1):
                x, _, slopes = self._advance(x, u, p, time + k * size, size, end)
            else:
                x, slopes = self._substep(x, u, p, time + k * size, size)
            moved = np.asarray(slopes) @ np.vstack([J, of_u])
            J = moved[: len(J)]
            dy = moved[len(J) :] if whole else dy
        return self._arranged(dy, J)

    def get(self, before: Vector) -> Matrix:
        """d(u, y, x)/d(u, y, x) of reading all outputs, which a plant evaluates anew."""
        (time,), u, p, y, x = self._parts(before)
        if self._output is None:
            return np.eye(len(u) + len(y) + len(x))
        slopes = np.asarray(self._output(x, u, p, time)[1])
        return self._arranged(slopes, np.eye(len(x), len(x) + len(u)))

    def _parts(self, state: Vector) -> list[Vector]:
        return np.split(state[-sum(self._n) :], np.cumsum(self._n)[:-1])

    def _arranged(self, y: Matrix, x: Matrix) -> Matrix:
        """Slopes of (u, y, x) by (u, y, x), from those of y and x by (x, u)."""
        n, m = len(x), y.shape[1] - len(x)
        rows = np.vstack([np.eye(m, n + m, n), y, x])
        return np.hstack([rows[:, n:], np.zeros((len(rows), len(y))), rows[:, :n]])


def _jacobian(arguments: list[ca.SX], results: list[ca.SX]) -> ca.Function:
    """The results, and their Jacobian by the first two arguments, x and u."""
    slopes = ca.jacobian(ca.vertcat(*results), ca.vertcat(*arguments[:2]))
    return ca.Function("slopes", arguments, [*results, ca.densify(slopes)])
