"""Explicit Runge-Kutta methods, each a Butcher tableau.

k_i = f(t + c_i h, x + h sum_j a_ij k_j),   x_{k+1} = x_k + h sum_i b_i k_i
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from hapticlink.components.integrators.base import Baumgarte, Integrator


@dataclass(frozen=True)
class Tableau:
    """a (strictly lower rows), b, c of an explicit method, and its order."""

    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    c: tuple[float, ...]
    order: int


class RungeKutta(Integrator):
    def __init__(self, name: str, tableau: Tableau, baumgarte: Baumgarte) -> None:
        self.name = name
        self.baumgarte = baumgarte
        self.tableau = tableau
        self.order = tableau.order
        self.extrapolates = any(abs(a) > 10 for row in tableau.a for a in row)

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
        slopes: list[ca.SX] = []
        for row, c in zip(self.tableau.a, self.tableau.c, strict=True):
            stage = sum((h * a * k for a, k in zip(row, slopes, strict=True) if a), start=x)
            slopes.append(ode(stage, u, p, t + c * h))
        return x + h * sum(b * k for b, k in zip(self.tableau.b, slopes, strict=True) if b)
