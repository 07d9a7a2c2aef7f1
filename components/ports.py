"""Declarations about a block's ports that coupling needs beyond name, shape and unit.

They are written to the FMU's annotation, so that they hold under any instance name in any system.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["projector", "semidefinite", "angle", "table", "count"]
"""The kind of an output whose entries cannot be extrapolated independently: an orthogonal
projector, a symmetric positive semidefinite matrix, wrapped angles, or a table, whose rows are
records and have no values between two samples, nor have whole numbers, a count."""

STEP_SIZE, FRAME_SIZE = "step_size", "frame_size"
"""Parameters that a run sets, where a block has them: the longest communication step (s) of the
block, and of the graphics copy. No block is built for a step size."""


@dataclass(frozen=True)
class Power:
    """Pairs an effort input (N, N.m) with its conjugate displacement, an output of the same block
    (m, rad): the power into the block is sign * effort . d(displacement)/dt."""

    displacement: str
    sign: float = 1.0


@dataclass(frozen=True)
class Gradient:
    """Of an output that gives the gradient of another one, `of` (k entries), in what an input `by`
    (n entries) brings: k x n, row by row, at the value of `by` that the output `at` (n) has."""

    of: str
    at: str
    by: str


@dataclass(frozen=True)
class SpringPorts:
    """A spring-damper within a block, whose far end is set by inputs:

        F = stiffness (set_position - position) + damping (set_velocity - velocity)

    entry by entry. set_position and set_velocity are inputs, position and velocity are inputs or
    outputs, stiffness and damping are parameters in the units of these, force is the output that
    is F, which acts with - on the far end; mobility is an input with that of both ends, where F is
    all that moves them apart; "" stands for none.
    """

    set_position: str
    position: str
    stiffness: str
    damping: str = ""
    set_velocity: str = ""
    velocity: str = ""
    force: str = ""
    mobility: str = ""


BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""The base units of every signal, in the order in which FMI and SSP list their exponents."""
