"""Fixed-step integration methods for plants; `METHODS` holds them by the names of a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hapticlink.components.integrators.base import Baumgarte, Integrator, MechanicalSystem, Ode
from hapticlink.components.integrators.linearly_implicit import LinearlyImplicit
from hapticlink.components.integrators.passive_midpoint import PassiveMidpoint
from hapticlink.components.integrators.runge_kutta import DORMAND_PRINCE_8, HEUN, RK4, RungeKutta
from hapticlink.components.integrators.semi_implicit_euler import SemiImplicitEuler
from hapticlink.components.registry import Registry, no_instance

if TYPE_CHECKING:  # a scene is checked against the names, and that needs no equations
    import casadi as ca

METHODS: Registry[Integrator] = Registry(
    "integrator",
    {
        "semi-implicit-euler": SemiImplicitEuler(),
        "heun": RungeKutta(HEUN, Baumgarte(math.sqrt(2), math.sqrt(0.5))),
        "linearly-implicit": LinearlyImplicit(),
        "rk4": RungeKutta(RK4),
        "dormand-prince-8": RungeKutta(DORMAND_PRINCE_8, Baumgarte(alpha_T=0.1)),
        "passive-midpoint": PassiveMidpoint(),
    },
    lambda part: no_instance(part, Integrator),
)


def step(
    method: str | Integrator,
    ode: ca.Function,
    x: ca.SX,
    u: ca.SX,
    p: ca.SX,
    t: ca.SX,
    h: ca.SX,
    positions: Sequence[int],
) -> ca.SX:
    """x(t + h) by a method, or by the one of that name, with ode: (x, u, p, t) -> x', constant u,
    and the entries of x that are positions (`Ode`). Raises ValueError for an unknown name, and for
    a method that gives no expression of x's size."""
    integrator = METHODS[method] if isinstance(method, str) else method
    after = integrator.step(Ode(ode, positions), x, u, p, t, h)
    return _of_size(after, x.numel(), integrator)


def mechanism_step(method: Integrator, mechanism: MechanicalSystem) -> ca.SX:
    """x(t + h) of a mechanism by a method, and below it by how much each of the method's counters
    grows. Raises ValueError for a method that gives no expression of that size."""
    size = mechanism.x.numel() + len(method.counters)
    return _of_size(method.mechanism_step(mechanism), size, method)


def _of_size(after: ca.SX, size: int, method: Integrator) -> ca.SX:
    shape = getattr(after, "shape", type(after).__name__)
    if shape != (size, 1):
        name = type(method).__name__
        raise ValueError(f"integrator {name}: its step gives {shape}, not {(size, 1)}")
    return after
