"""What an integrator is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Baumgarte:
    """Default stabilisation of (3.3) for a method of step h: alpha = alpha_h / h, and beta."""

    alpha_h: float
    beta: float


class Integrator(ABC):
    """One method. `order` is the global one; a step is a pure expression in x, u, p, t, h.

    extrapolates: stages weigh earlier ones by far more than 1, and their rounding with them."""

    name: str
    order: int
    extrapolates: bool = False
    baumgarte: Baumgarte

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
