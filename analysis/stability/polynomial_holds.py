"""Holds whose value is a polynomial in time between two samples, as linear systems of their own.

With the value y and its powers c_k = y^(k)/k! (per tick^k) up to the degree d of the hold, dt later

    c_j <- sum over k >= j of binomial(k, j) dt^(k - j) c_k,   c_0 = y

whatever the age of the samples: all evaluations between two samples are one matrix. Only the first
one behind a sample, and the first of a period, depends on the samples, with weights that follow
from the hold itself at d + 1 instants: its values for samples that are 0 but for one entry of 1.
A mean is such a hold of degree 0, whose sum begins anew where it is evaluated (`slopes_of_sums`).
Behind a manifold the law is taken without it: samples lie on it, so that at rest what moves them
is tangent to it, which the nearest matrix there leaves as it is to the first order. (By differences
of single entries, which leave it, a matrix next to one of lower rank turns: of a linkage that is
almost stretched, 1e-6 of them gave slopes that were off by 1 %.) By the efforts that `ahead` reads
beside its samples the weights are slopes. Its law changes where a sample
describes the present: the instants are taken on the side on which it is asked.
"""

from __future__ import annotations

import ctypes
from math import comb

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold
from hapticlink.orchestrator.run.compiled.state import StateBlock

STEP = 1e-6
"""Of differences, relative to max(1, |z|)."""
OF_SAMPLES = ("samples", "lead", "mean")
"""What takes the samples of a hold that keeps nothing but these, or sums of them."""
LESS = {"WITH_RATE": 0, "WITH_POSE": 1, "ALONE": 2}
"""By how much a cubic, its slope and a line are of less than degree 3, of `ahead`."""


def is_polynomial(hold: CompiledHold) -> bool:
    """Whether the value of a hold is a polynomial in time through its samples."""
    row = hold.row
    alone = row.needs == "step" or not hold.parts.beside
    return row.push in OF_SAMPLES and row.degree is not None and alone


def read_by(hold: CompiledHold) -> NDArray[np.intp]:
    """The indices of the signals that a hold reads beside its samples."""
    beside = hold.parts.beside
    return np.unique(beside.where) if beside else np.zeros(0, np.intp)


def degree_of(hold: CompiledHold) -> int:
    """The degree d of a hold that is a polynomial."""
    degree = hold.row.degree
    assert degree is not None
    return degree - LESS[hold.parts.relation] if hold.row.needs == "step" else degree


def is_linear(hold: CompiledHold) -> bool:
    """Whether the value of a hold without a regime is linear in what it reads."""
    return not hold.parts.matrix and not hold.parts.beside


def is_ageless(hold: CompiledHold) -> bool:
    """Whether the value of a hold follows from its samples, or their sum over a span, and the
    coordinates of the moment."""
    row = hold.row
    ageless = row.gives_samples or row.push == "mean" or row.needs == "gradient"
    return ageless and row.degree == 0 and not hold.link


def sample_arrives(hold: CompiledHold, tick: int) -> bool:
    """Whether a sample in transit is there at a tick, and not taken yet."""
    link = hold.link
    return (
        link is not None and link.n > 0 and ctypes.c_int64.from_address(link.arrivals).value <= tick
    )


def slopes_of_powers(
    hold: CompiledHold, block: StateBlock, board: Vector, tick: int, ahead: float
) -> Matrix:
    """The slopes of (c_0, ..., c_d), n numbers each, of a hold at a tick and so much `ahead` of it,
    by the numbers of its state, the `block`, and by what it reads beside these on the `board`."""
    state, degree, own = block.save(), degree_of(hold), hold.c
    spacing = own.stamps[own.count - 1] - own.stamps[own.count - 2] if own.count > 1 else 1
    between = (
        own.count and tick + ahead < own.stamps[own.count - 1]
    )  # samples, at which the law of `ahead` ends
    at = np.arange(degree + 1.0) * (-spacing if between else spacing)
    reads, size = read_by(hold), len(state.numbers)
    z = np.concatenate([state.numbers, board[reads]])
    known = z if hold.parts.beside else np.zeros_like(z)
    steps = STEP * np.maximum(1.0, np.abs(z)) if hold.parts.beside else np.ones(len(z))
    own.manifold, manifold = 0, own.manifold

    def values(numbers: Vector) -> Matrix:
        block.restore(state, numbers[:size])
        board[reads] = numbers[size:]
        return np.array([hold.value(tick, ahead + later) for later in at])

    moved = np.array([values(known + step) - values(known - step) for step in np.diag(steps)]) / 2
    own.manifold = manifold
    values(z)
    slopes = np.moveaxis(moved, 0, -1) / steps  # (instants, n, numbers)
    powers = np.linalg.inv(np.vander(np.arange(degree + 1.0), increasing=True))
    scaled = powers / float(at[min(1, degree)] or 1.0) ** np.arange(degree + 1)[:, None]
    result: Matrix = np.tensordot(scaled, slopes, 1).reshape(-1, len(z))
    return result


def slopes_of_sums(hold: CompiledHold, block: StateBlock, tick: int) -> Matrix:
    """The slopes of the numbers of the state of a hold, the `block`, by themselves, where it is
    evaluated: a mean is taken then, and its sum begins anew. What a manifold makes of the value
    changes no state."""
    state = block.save()
    after = np.eye(len(state.numbers))
    for numbers in after if hold.row.push == "mean" else ():
        block.restore(state, numbers)
        hold.value(tick, 0.0)
        numbers[:] = block.numbers()
    block.restore(state, state.numbers)
    return after.T


def advanced_powers(hold: CompiledHold, dt: float) -> Matrix:
    """The slopes of (c_0, ..., c_d) by themselves over dt (ticks)."""
    every = range(degree_of(hold) + 1)
    own = [[comb(k, j) * dt ** max(0, k - j) for k in every] for j in every]
    result: Matrix = np.kron(np.array(own), np.eye(hold.c.n))
    return result
