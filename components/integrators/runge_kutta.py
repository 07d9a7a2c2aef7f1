"""Explicit Runge-Kutta methods, each given by its Butcher tableau: Heun's method of order 2, the
classical one of order 4, and in dormand_prince_8.py one of order 8.

    k_i = f(t + c_i h, x + h sum_j a_ij k_j),   x_{k+1} = x_k + h sum_i b_i k_i

Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hapticlink.components.integrators.base import Baumgarte, Integrator, Ode

if TYPE_CHECKING:
    import casadi as ca

ROUNDING = 1e-13
"""Tolerance for coefficients given as decimals, relative to the sum of their magnitudes."""


@dataclass(frozen=True)
class Tableau:
    """Coefficients a (rows of the strictly lower triangle), b and c of an explicit method, and its
    order.

    Raises ValueError if a row of a does not sum to its c, or if the method does not integrate
    powers of t up to its order: sum_i b_i c_i^(k-1) = 1/k for k = 1..order, the first of which is
    that b sums to 1. (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.1 and
    II.2; order conditions of branched trees are not checked.)
    """

    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    c: tuple[float, ...]
    order: int

    def __post_init__(self) -> None:
        lengths = [len(row) for row in self.a]
        if lengths != list(range(len(self.b))) or len(self.c) != len(self.b):
            raise ValueError(
                f"tableau: {len(self.b)} b, {len(self.c)} c and rows of a of {lengths} entries; "
                "an explicit method has as many b as c, and i - 1 entries in row i of a"
            )
        for i, (row, c) in enumerate(zip(self.a, self.c, strict=True), start=1):
            _require(row, c, f"row {i} of a should sum to c = {c!r}")
        for k in range(1, self.order + 1):
            terms = [b * c ** (k - 1) for b, c in zip(self.b, self.c, strict=True)]
            name = "b" if k == 1 else f"b c^{k - 1}"
            total = "1" if k == 1 else f"1/{k}"
            _require(terms, 1 / k, f"{name} should sum to {total} for order {self.order}")


def _require(terms: Sequence[float], total: float, what: str) -> None:
    if abs(sum(terms) - total) > ROUNDING * (1 + sum(map(abs, terms))):
        raise ValueError(f"tableau: {what}, and sums to {sum(terms)!r}")


class RungeKutta(Integrator):
    """The explicit method of a tableau; baumgarte: its default gains, if better ones are known than
    those that suit any method."""

    def __init__(self, tableau: Tableau, baumgarte: Baumgarte | None = None) -> None:
        self.tableau, self.baumgarte = tableau, baumgarte or Baumgarte()
        self.order = tableau.order
        self.extrapolates = any(abs(a) > 10 for row in tableau.a for a in row)

    def step(self, ode: Ode, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX, h: ca.SX) -> ca.SX:
        slopes: list[ca.SX] = []
        for row, c in zip(self.tableau.a, self.tableau.c, strict=True):
            stage = sum((h * a * k for a, k in zip(row, slopes, strict=True) if a), start=x)
            slopes.append(ode(stage, u, p, t + c * h))
        return x + h * sum(b * k for b, k in zip(self.tableau.b, slopes, strict=True) if b)


HEUN = Tableau(a=((), (1.0,)), b=(0.5, 0.5), c=(0.0, 1.0), order=2)
RK4 = Tableau(
    a=((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
    b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
    c=(0.0, 0.5, 0.5, 1.0),
    order=4,
)
