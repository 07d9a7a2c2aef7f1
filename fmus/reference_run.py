"""A short run of one block alone, for its page of documentation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hapticlink.components.component import Component, Variable

DURATION, STEPS = 0.5, 256
"""Of the run (s), and how many steps it takes at most: each build of a block waits for it."""
AMPLITUDES: Mapping[str, float] = {"N": 0.5, "N.m": 0.0025, "m": 0.001, "rad": 0.01}
"""Of the sines by which a scalar or vector input of this unit moves."""


@dataclass(frozen=True)
class ReferenceRun:
    """What the block did: rows of samples by name of the variable's entry."""

    times: np.ndarray
    """(s), one for each step."""
    moved: Mapping[str, np.ndarray]
    """Inputs that move."""
    answers: Mapping[str, np.ndarray]
    """All outputs."""
    duration: float
    """(s)."""


def reference_run(component: Component, step_size: float) -> ReferenceRun:
    """The run from the start values, over half a second, 256 steps at most, or until a value is not
    finite.

    Entry k = 0, 1 ... of the wrenches and poses among the inputs is its start value plus
    a sin(2 pi (2 + k) t), which a hand can do; other inputs keep their start values.
    step_size (s): of the communication steps.
    """
    start, p = np.array(component.start_inputs), np.array(component.start_parameters)
    amplitude = np.array([a for v in component.inputs for a in _amplitudes(v)])
    frequency = 1 + np.cumsum(amplitude > 0)
    times = np.arange(min(STEPS, max(1, round(DURATION / step_size)))) * step_size
    inputs = start + amplitude * np.sin(2 * math.pi * frequency * times[:, None])

    U, P, T = inputs.T, np.tile(p, (len(times), 1)).T, times[None, :]
    x0 = component.initialize(inputs[0], p)
    X = _step(component, step_size).mapaccum("run", len(times))(x0, U, P, T).full()
    if component.timing == "sampled":
        X, at = np.hstack([np.array(x0), X[:, :-1]]), T
    else:
        at = T + step_size
    Y = component.output.map(len(times))(X, U, P, at).full().T
    rows = Y[: int(np.cumprod(np.isfinite(Y).all(axis=1)).sum())]
    of_inputs = [name for v in component.inputs for name in v.names]
    of_outputs = (name for v in component.outputs for name in v.names)
    return ReferenceRun(
        times=times[: len(rows)],
        moved={of_inputs[i]: inputs[: len(rows), i] for i in np.flatnonzero(amplitude)},
        answers=dict(zip(of_outputs, rows.T, strict=True)) if len(rows) else {},
        duration=len(rows) * step_size,
    )


def _amplitudes(variable: Variable) -> Iterator[float]:
    """By entry; 0 for what keeps its start value."""
    for unit in variable.units:
        yield AMPLITUDES.get(unit, 0.0) if len(variable.shape) < 2 else 0.0


def _step(component: Component, step_size: float) -> ca.Function:
    """(x, u, p, t) -> the state after one communication step."""
    n = component.substeps
    parts = [component.substep or component.step] * n
    parts[0 if component.timing == "sampled" else -1] = component.step
    start, u, p, t = (ca.MX.sym(name, component.step.size1_in(i)) for i, name in enumerate("xupt"))
    x = start
    for k, part in enumerate(parts):
        x = part(x, u, p, t + k * step_size / n, step_size / n)
    return ca.Function("after", [start, u, p, t], [x])
