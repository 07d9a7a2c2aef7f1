"""The base class of integration methods."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import casadi as ca


class Integrator(ABC):
    """An integration method; a step is a pure expression in x, u, p, t, h.

    order: order of the global error. extrapolates: whether coefficients of earlier stages are much
    larger than 1, so that their rounding errors are amplified."""

    order: int
    extrapolates: bool = False

    @abstractmethod
    def step(
        self,
        ode: ca.Function,
        x: ca.SX,
        u: ca.SX,
        p: ca.SX,
        t: ca.SX,
        h: ca.SX,
        positions: Sequence[int],
    ) -> ca.SX:
        """x(t + h) from x(t), with ode: (x, u, p, t) -> x'."""
