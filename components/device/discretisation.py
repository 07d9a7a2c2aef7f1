"""Discrete equivalents of a continuous system: the three rules of the report's section 1.3.1.

    forward      (1.1)   xdot(k)                    = (x(k+1) - x(k)) / T
    backward     (1.2)   xdot(k+1)                  = (x(k+1) - x(k)) / T
    trapezoidal  (1.3)   (xdot(k+1) + xdot(k)) / 2  = (x(k+1) - x(k)) / T

(1.3) is printed with a minus sign; with it even a constant xdot would not move x. All
three are one equation with the weight gamma on the end of the step,

    x(k+1) = x(k) + T [(1 - gamma) xdot(k) + gamma xdot(k+1)].
"""

from __future__ import annotations

from typing import Any

import casadi as ca

WEIGHT = {"forward": 0.0, "backward": 1.0, "trapezoidal": 0.5}


def weight(rule: str) -> float:
    """gamma of the rule. Raises ValueError for an unknown rule."""
    if rule not in WEIGHT:
        raise ValueError(f"`rule`: {rule!r} is unknown; take one of {', '.join(WEIGHT)}")
    return WEIGHT[rule]


def pole(rule: str, sT: Any) -> Any:
    """z = (1 + (1 - gamma) sT) / (1 - gamma sT), the discrete pole of a pole s (figure 1.4).

    sT: complex number or array. The discrete system is stable iff |z| < 1.
    """
    gamma = weight(rule)
    return (1 + (1 - gamma) * sT) / (1 - gamma * sT)


def step(rule: str, A: ca.SX, B: ca.SX, x: ca.SX, u: ca.SX, u_next: ca.SX, period: ca.SX) -> ca.SX:
    """x(k+1) of xdot = A x + B u, A (n, n) and B (n, m) frozen over the period (s).

        (I - gamma T A) x(k+1) = (I + (1 - gamma) T A) x(k) + T B [(1 - gamma) u(k) + gamma u(k+1)]

    The forward rule is explicit; the others solve their n equations in the graph.
    """
    gamma = weight(rule)
    right = x + period * ((1 - gamma) * (A @ x) + B @ ((1 - gamma) * u + gamma * u_next))
    if gamma == 0:
        return right
    return ca.solve(ca.SX.eye(x.numel()) - gamma * period * A, right)
