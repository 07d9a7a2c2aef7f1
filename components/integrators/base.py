"""The contract of integration methods: a method is a class derived from `Integrator`.

`step` takes any plant x' = f(x, u, p, t). `mechanism_step` takes a mechanism, of which a method may
know more than its equations of motion (`MechanicalSystem`); by default it applies `step` to these.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:  # a scene is checked against the names of methods, and that needs no equations
    import casadi as ca


@dataclass(frozen=True)
class Ode:
    """The equations x' = f(x, u, p, t) of a plant, called as a function of columns."""

    rate: ca.Function
    """(x, u, p, t) -> x'."""
    positions: Sequence[int] = ()
    """The entries of x that are positions. The entries that are none begin with the velocities, as
    many as positions and in their order: q' = v."""

    def __call__(self, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX) -> ca.SX:
        return self.rate(x, u, p, t)


class MechanicalSystem(ABC):
    """A mechanism within one step, with x = (q, qd, z), z further states such as deflections of
    friction:

        D qdd + C qd = Q + W' lambda,   W qdd + w = 0   (B.6)

    Bodies have the velocities V = J(q) qd, a constant inertia M, and D = J' M J. Q depends on the
    motion or is rigid (`forces`). Inputs u are constant over the step.
    """

    x: ca.SX
    """q, qd (n x 1 each) and z at the beginning of the step."""
    u: ca.SX
    p: ca.SX
    t: ca.SX
    """The beginning of the step (s)."""
    h: ca.SX
    """Its size (s)."""
    n: int
    """Number of coordinates."""

    @abstractmethod
    def integrated(self, method: Integrator) -> ca.SX:
        """x(t + h) by `method.step`, with begins and ends of contacts located and with the closures
        stabilised, as the scene chooses."""

    @abstractmethod
    def projected(self, x: ca.SX) -> ca.SX:
        """x with q and qd on the closures, if the scene chooses projection."""

    @property
    @abstractmethod
    def rates(self) -> ca.Function:
        """(x, u, p, t) -> z'."""

    @property
    @abstractmethod
    def forces(self) -> ca.Function:
        """(x, u, p, t) -> generalised forces, n x 1 each: those that depend on the motion, all
        others, and those of drives, which are a part of the first."""

    @property
    @abstractmethod
    def energies(self) -> ca.Function:
        """(x, u, p, t) -> the whole and the kinetic energy (J), and the displacements r (k x 1) in
        which inputs do work, of which the last n are q."""

    @property
    @abstractmethod
    def input_efforts(self) -> ca.Function:
        """u -> the efforts of inputs (k x 1), whose power is efforts . r'."""

    @property
    @abstractmethod
    def displacement_rates(self) -> ca.Function:
        """(q, qd, p) -> r', k x 1."""

    @property
    @abstractmethod
    def velocities(self) -> ca.Function:
        """(q, qd, p) -> V = J(q) qd of all bodies."""

    @abstractmethod
    def constrained_solver(self, *, softened: bool) -> ca.Function:
        """(q, V, b, A, s, p) -> a with (D + A) a = J' M V + b + W' lambda and W (s + a) = 0 at q.
        A is n x n if `softened`, else empty and left out."""


@dataclass(frozen=True)
class Baumgarte:
    """Gains of Baumgarte's stabilisation of (3.3), hddot + 2 alpha beta hdot + alpha^2 h = 0, for
    steps of T: alpha = alpha_T / T (1/s), and beta.

    The roots of the closure error times the step T are z = alpha T (-beta +- sqrt(beta^2 - 1)). A
    Runge-Kutta method multiplies its modes by the stability polynomial R(z) in each step, so
    alpha T has a limit, and the error that the terms introduce grows with it. Limits at beta = 1,
    and the reason for each default:

        semi-implicit-euler  .83, 2 (sqrt(beta^2 + 1) - beta)  dead beat: both roots are 0
        heun                 2.0                               dead beat: 1 + z + z^2/2 = 0
        rk4                  2.79                              smallest error of the tip, .02 to .05
        dormand-prince-8     6.4                               gap at rounding from .05 to .2
        linearly-implicit    none                              error of the tip grows from .1 on

    Gap of the five-bar at 512 Hz, in m, by alpha T at beta = 1 (0 is unstabilised):

                                                0       .02     .05     .1      .5      dead beat
        rk4, 3 s under the wrench of chapter 6  2e-8    7e-10   5e-10   2e-9    7e-8
        rk4, 60 s undamped, 12.6 mJ             2e-8    3e-11   2e-10   6e-10
        heun, 60 s undamped                     3.5e-6                                  1e-8
        semi-implicit Euler, 20 s undamped      1.9e-2                                  2e-6
    """

    alpha_T: float = 0.05
    beta: float = 1.0


HELD_MODEL = Baumgarte(0.4, 1.0)
"""Gains of the local model, with T the frame period: W is up to a frame old, so that a faster
correction overshoots. Projection with held matrices diverges for the same reason."""

ContactState = Literal["pushing", "sticking"]


class Integrator(ABC):
    """An integration method; a step is a pure expression."""

    order: int
    """Order of the global error."""
    extrapolates: bool = False
    """Whether coefficients of earlier stages are much larger than 1, so that their rounding errors
    are amplified."""
    l_stable: bool = False
    """Whether modes of any stiffness die out, so that friction does not bound the step."""
    bounded_by: frozenset[ContactState] = frozenset({"pushing", "sticking"})
    """The contacts whose stiffness and damping bound the step of a mechanism."""
    baumgarte: Baumgarte = Baumgarte()
    """Default gains of Baumgarte's stabilisation, by default those that suit any method."""
    counters: Mapping[str, str] = MappingProxyType({})
    """What the method counts over the steps of a mechanism, by name with a description: further
    states and outputs of the mechanism, which start at 0."""

    @abstractmethod
    def step(self, ode: Ode, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX, h: ca.SX) -> ca.SX:
        """x(t + h) from x(t) by x' = ode(x, u, p, t) with constant u."""

    def mechanism_step(self, mechanism: MechanicalSystem) -> ca.SX:
        """x(t + h) of a mechanism, and below it by how much each of `counters` grows."""
        return mechanism.integrated(self)

    def misfit(self, *, baumgarte: bool, held: bool) -> str:
        """Why the method cannot take steps of a mechanism, "" if it can. baumgarte: its closures
        are stabilised by Baumgarte's method; held: its matrices are inputs (local_model)."""
        return ""
