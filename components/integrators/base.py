"""What an integrator is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import casadi as ca


class Integrator(ABC):
    """One method. `order` is the global one; a step is a pure expression in x, u, p, t, h.

    extrapolates: stages weigh earlier ones by far more than 1, and their rounding with them."""

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
