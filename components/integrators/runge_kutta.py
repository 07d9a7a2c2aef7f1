"""Explicit Runge-Kutta methods, each given by its Butcher tableau: Heun's method of order 2, the
classical one of order 4, and Dormand and Prince's of order 8.

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

# fmt: off
DORMAND_PRINCE_8 = Tableau(
    a=(
        (),
        (0.05260015195876773,),
        (0.0197250569845379, 0.0591751709536137,),
        (0.02958758547680685, 0, 0.08876275643042054,),
        (0.2413651341592667, 0, -0.8845494793282861, 0.924834003261792,),
        (0.037037037037037035, 0, 0, 0.17082860872947386, 0.12546768756682242,),
        (0.037109375, 0, 0, 0.17025221101954405, 0.06021653898045596, -0.017578125,),
        (0.03709200011850479, 0, 0, 0.17038392571223998, 0.10726203044637328,
         -0.015319437748624402, 0.008273789163814023,),
        (0.6241109587160757, 0, 0, -3.3608926294469414, -0.868219346841726, 27.59209969944671,
         20.154067550477894, -43.48988418106996,),
        (0.47766253643826434, 0, 0, -2.4881146199716677, -0.590290826836843, 21.230051448181193,
         15.279233632882423, -33.28821096898486, -0.020331201708508627,),
        (-0.9371424300859873, 0, 0, 5.186372428844064, 1.0914373489967295, -8.149787010746927,
         -18.52006565999696, 22.739487099350505, 2.4936055526796523, -3.0467644718982196,),
        (2.273310147516538, 0, 0, -10.53449546673725, -2.0008720582248625, -17.9589318631188,
         27.94888452941996, -2.8589982771350235, -8.87285693353063, 12.360567175794303,
         0.6433927460157636,),
    ),
    b=(0.054293734116568765, 0, 0, 0, 0, 4.450312892752409, 1.8915178993145003,
       -5.801203960010585, 0.3111643669578199, -0.1521609496625161, 0.20136540080403034,
       0.04471061572777259),
    c=(0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726,
       0.3333333333333333, 0.25, 0.3076923076923077, 0.6512820512820513, 0.6,
       0.8571428571428571, 1.0),
    order=8,
)
# fmt: on
"""Dormand and Prince's method of order 8 with 12 stages, as DOP853 has it, without its error
estimate and dense output: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I
(1993), section II.5 and the code of the appendix, whose coefficients these are."""
