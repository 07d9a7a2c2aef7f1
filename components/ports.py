"""What a block's ports mean to whoever couples it, beyond name, shape and unit.

It travels in the FMU, so that it holds under any instance name, in any system.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["projector", "semidefinite", "angle", "table"]
"""What an output is, where its entries must not be held each for itself: an orthogonal projector,
a symmetric positive semidefinite matrix, angles that wrap, or a table whose rows name things, of
which there is none between two samples."""


@dataclass(frozen=True)
class Power:
    """An input's effort (N, N.m) works on an output of the same block, `displacement` (m, rad):
    the power into the block is sign * effort . d(displacement)/dt."""

    displacement: str
    sign: float = 1.0


@dataclass(frozen=True)
class Spring:
    """A spring-damper within a block, set by its inputs:

        F = stiffness (set_position - position) + damping (set_velocity - velocity)

    entry by entry. set_position and set_velocity are inputs, position is an input or an output,
    stiffness and damping are parameters in the units of these; "" is none.
    """

    set_position: str
    position: str
    stiffness: str
    damping: str = ""
    set_velocity: str = ""
