"""Holds whose value is a polynomial in time between two samples, as linear systems of their own.

With the value y and its powers c_k = y^(k)/k! (per tick^k) up to the degree d of the hold, dt later

    c_j <- sum over k >= j of binomial(k, j) dt^(k - j) c_k,   c_0 = y

whatever the age of the samples: all evaluations between two samples are one matrix. Only the first
one behind a sample, and the first of a period, depends on the samples, with weights that follow
from the hold itself at d + 1 instants: its values for samples that are 0 but for one entry of 1.
Behind a manifold, where the value is not linear in the samples, they are slopes at these.
"""

from __future__ import annotations

import ctypes
from math import comb

import numpy as np

from hapticlink.orchestrator.base.arrays import Matrix
from hapticlink.orchestrator.run.compiled.hold_structures import CompiledHold
from hapticlink.orchestrator.run.compiled.state import StateBlock

STEP = 1e-6
"""Of differences, relative to max(1, |z|)."""
OF_SAMPLES = ("samples", "lead")
"""What takes the samples of a hold that keeps nothing else."""


def is_polynomial(hold: CompiledHold) -> bool:
    """Whether the value of a hold is a polynomial in time through its samples."""
    row = hold.row
    return row.push in OF_SAMPLES and row.degree is not None and not hold.parts.beside


def degree_of(hold: CompiledHold) -> int:
    """The degree d of a hold that is a polynomial."""
    assert hold.row.degree is not None
    return hold.row.degree


def is_linear(hold: CompiledHold) -> bool:
    """Whether the value of a hold without a regime is linear in what it reads."""
    return not hold.parts.matrix and not hold.parts.beside


def is_ageless(hold: CompiledHold) -> bool:
    """Whether the value of a hold follows from its sample and the coordinates of the moment."""
    return hold.row.needs == "gradient" and hold.row.degree == 0 and not hold.link


def sample_arrives(hold: CompiledHold, tick: int) -> bool:
    """Whether a sample in transit is there at a tick, and not taken yet."""
    link = hold.link
    return (
        link is not None and link.n > 0 and ctypes.c_int64.from_address(link.arrivals).value <= tick
    )


def slopes_of_powers(hold: CompiledHold, block: StateBlock, tick: int, ahead: float) -> Matrix:
    """The slopes of (c_0, ..., c_d), n numbers each, of a hold at a tick and so much `ahead` of it,
    by the numbers of its state, the `block`."""
    state, degree, own = block.save(), degree_of(hold), hold.c
    spacing = own.stamps[own.count - 1] - own.stamps[own.count - 2] if own.count > 1 else 1
    at = np.arange(degree + 1.0) * spacing
    size = len(state.numbers)
    z = np.zeros(size) if is_linear(hold) else state.numbers
    steps = np.ones(size) if is_linear(hold) else STEP * np.maximum(1.0, np.abs(z))

    def values(numbers: Matrix) -> Matrix:
        block.restore(state, numbers)
        return np.array([hold.value(tick, ahead + later) for later in at])

    moved = np.array([values(z + step) - values(z - step) for step in np.diag(steps)]) / 2
    block.restore(state, state.numbers)
    slopes = np.moveaxis(moved, 0, -1) / steps  # (instants, n, numbers)
    powers = np.linalg.inv(np.vander(np.arange(degree + 1.0), increasing=True))
    scaled = powers / float(spacing) ** np.arange(degree + 1)[:, None]
    result: Matrix = np.tensordot(scaled, slopes, 1).reshape(-1, size)
    return result


def advanced_powers(hold: CompiledHold, dt: float) -> Matrix:
    """The slopes of (c_0, ..., c_d) by themselves over dt (ticks)."""
    every = range(degree_of(hold) + 1)
    own = [[comb(k, j) * dt ** max(0, k - j) for k in every] for j in every]
    result: Matrix = np.kron(np.array(own), np.eye(hold.c.n))
    return result
