"""What stands in the place of a sampled FMU whose state cannot be read: the linear system that its
response to its inputs shows, around the inputs u0 and outputs y0 at which the scene starts.

    x_{k+1} = A x_k + B (u_k - u0),    y_k = y0 + C x_k + D (u_k - u0)

The FMU is run from its start with u0 until its outputs rest; then each input alone has a pulse of
one step, up and down. Half the difference of both responses is its column of the Markov parameters
M_0 = D, M_i = C A^(i-1) B, and half their sum shows what is not linear. The smallest system with
these parameters follows from the singular values of their Hankel matrix (B. L. Ho and R. E. Kalman,
Effective construction of linear state-variable models from input/output functions,
Regelungstechnik 14, 1966; S. Kung, A new identification and model reduction algorithm via singular
value decomposition, 1978). It is checked on inputs that took no part: all of them at random, from
the first step on and longer than the pulses, so that what changes with time shows, too; and on
those of a run, which are as large as they come.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hapticlink.orchestrator.base.arrays import Matrix, Vector

SETTLING = 512
"""Steps with constant inputs after which outputs have to rest."""
LENGTH = 128
"""Steps of a response to a pulse, which shows an order up to half of it in each input."""
CHECKED = 512
"""Steps of the response to inputs that took no part."""
PULSE = 1e-4
"""Height of a pulse, relative to max(1, |u0|)."""
LARGER = 100.0
"""Times as high is a pulse that has to do nothing where the pulse does nothing."""
NULL = 1e-9
"""Singular values below it, relative to the largest, are none."""
RESTS = 1e-6
"""Largest change of outputs with constant inputs, relative to the response to the pulses."""
EXACT = 1e-3
"""Largest error on the inputs that took no part, and largest share that is not linear, relative to
the largest response."""
Respond = Callable[[Matrix], Matrix]
"""Outputs (k, n_y) of the steps of a new run with the inputs (k, n_u)."""


class NotIdentified(Exception):
    """No linear system is told by the response, with the reason."""


@dataclass(frozen=True, eq=False)
class IdentifiedSystem:
    """The system of the module. Largest difference of an output on inputs that took no part,
    relative to its largest response to them: `error` of small ones, `early` of these within the
    SETTLING steps behind which it was identified, `on_run` of those of a run, None without one."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    u0: Vector
    y0: Vector
    error: float
    early: float = 0.0
    on_run: float | None = None

    @property
    def order(self) -> int:
        return len(self.A)


def identify(
    respond: Respond, u0: Vector, names: Sequence[str], run: Matrix | None = None
) -> IdentifiedSystem:
    """The system that an FMU is next to the inputs u0 of these names; checked on the inputs of a
    `run`, too. Raises NotIdentified."""
    pulses = PULSE * np.maximum(1.0, np.abs(u0))
    steps = SETTLING + LENGTH
    rest = respond(np.tile(u0, (steps, 1)))
    if not np.isfinite(rest).all():
        raise NotIdentified("its outputs are not finite with constant inputs")

    def pulsed(j: int, height: float) -> Matrix:
        inputs = np.tile(u0, (steps, 1))
        inputs[SETTLING, j] += height
        return respond(inputs)[SETTLING:] - rest[SETTLING:]

    sides = [(pulsed(j, h), pulsed(j, -h)) for j, h in enumerate(pulses)]
    up, down = (np.stack(each, axis=2) for each in zip(*sides, strict=True))  # (k, y, u)
    size, least = np.abs(up).max(axis=(0, 2), initial=0.0), _rounding(rest)  # of each output
    scale = np.where(size > least, size, 1.0)
    _require_rest(rest[SETTLING:], np.maximum(RESTS * size, least))
    bent = (np.abs(up + down) / 2).max(axis=(0, 2), initial=0.0) / scale
    if not bent.max(initial=0.0) <= EXACT:
        raise NotIdentified(
            f"{bent.max():.2g} of its response to small pulses is not linear: it is at a kink, "
            "such as a limit, friction or a count"
        )
    nothing = (np.abs(up).max(axis=0) <= least[:, None]).all(axis=0)
    for j in np.flatnonzero(nothing).tolist():
        if (np.abs(pulsed(j, LARGER * pulses[j])) > least).any():
            raise NotIdentified(
                f"{names[j]} does nothing by {pulses[j]:.1g} and something by {LARGER:g} times "
                "as much: a count or a dead zone, which has no slope"
            )
    markov = (up - down) / 2 / scale[:, None]
    A, B, C = _realise(markov[1:])
    D = markov[0]
    found = IdentifiedSystem(
        A, B / pulses, scale[:, None] * C, scale[:, None] * D / pulses, u0, rest[-1], 0.0
    )
    error, early = _check(found, respond, pulses)
    on_run = None if run is None else next(_errors(found, respond, run, slice(None)))
    return replace(found, error=error, early=early, on_run=on_run)


def _rounding(rest: Matrix) -> Vector:
    """The changes of outputs up to which they may be rounding."""
    return 1e-12 * np.maximum(1.0, np.abs(rest).max(axis=0))


def _require_rest(rest: Matrix, most: Vector) -> None:
    moving = np.flatnonzero(np.ptp(rest, axis=0) > most)
    if len(moving):
        raise NotIdentified(
            f"{len(moving)} of its outputs move with constant inputs: what changes with time, or "
            "integrates an error that is not 0 at the start, has no rest there"
        )


def _realise(markov: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """A, B, C of the smallest system with C A^i B = markov[i], up to NULL."""
    half = len(markov) // 2
    _, n_y, n_u = markov.shape
    blocks = [[markov[i + j] for j in range(half)] for i in range(half + 1)]
    whole = np.block(blocks)
    U, s, Vt = np.linalg.svd(whole[:-n_y], full_matrices=False)
    r = int(np.count_nonzero(s > NULL * s.max(initial=0.0)))
    root = np.sqrt(s[:r])
    A = (U[:, :r] / root).T @ whole[n_y:] @ (Vt[:r] / root[:, None]).T
    return A, (root[:, None] * Vt[:r])[:, :n_u], (U[:, :r] * root)[:n_y]


def _check(found: IdentifiedSystem, respond: Respond, pulses: Vector) -> tuple[float, float]:
    """The errors on small inputs that took no part, behind SETTLING steps and in these. Raises
    NotIdentified where the first one is larger than EXACT."""
    first = SETTLING + SETTLING // 8
    inputs = np.tile(found.u0, (first + CHECKED, 1))
    draws = np.random.default_rng(1).uniform(-1.0, 1.0, (len(inputs) - 1, len(pulses)))
    inputs[1:] += pulses * draws
    error, early = _errors(found, respond, inputs, slice(first, None), slice(SETTLING))
    if not error <= EXACT:
        raise NotIdentified(
            f"a linear system of order {found.order}, identified by pulses, errs by {error:.2g} of "
            f"its response to other inputs: it is not linear, has a memory of more than "
            f"{LENGTH // 2} steps, or changes with time"
        )
    return error, early


def _errors(
    found: IdentifiedSystem, respond: Respond, inputs: Matrix, *parts: slice
) -> Iterator[float]:
    """For parts of the inputs, how far the system is from what these change, from the first of them
    on, relative to the largest change of an output there."""
    rest = respond(np.tile(inputs[0], (len(inputs), 1)))
    moved = respond(inputs) - rest
    x, wrong = np.zeros(found.order), np.empty_like(moved)
    for k, du in enumerate(inputs - inputs[0]):
        wrong[k] = found.C @ x + found.D @ du - moved[k]
        x = found.A @ x + found.B @ du
    for part in parts:
        largest = np.maximum(np.abs(moved[part]).max(axis=0), _rounding(rest))
        yield float((np.abs(wrong[part]).max(axis=0) / largest).max(initial=0.0))
