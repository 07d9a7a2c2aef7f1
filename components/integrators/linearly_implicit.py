"""ROS2, linearly implicit, order 2 and L-stable: for stiff springs, servos and contacts.

(1 - gamma h J) k_1 = f(t, x),   (1 - gamma h J) k_2 = f(t + h, x + h k_1) - 2 k_1
x_{k+1} = x_k + h (3 k_1 + k_2)/2,   gamma = 1 - 1/sqrt 2,   J = df/dx at (t, x)

Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20 (1999), 1456: order 2 with any J, so that
kinks of a force do not reduce the order. There is no iteration: two evaluations of f, one J by
algorithmic differentiation and one factorisation, of n x n since q' = v:

(1 - gamma h J_vv - (gamma h)^2 J_vq) k_v = r_v + gamma h J_vq r_q,   k_q = r_q + gamma h k_v
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hapticlink.components.integrators.base import Integrator

if TYPE_CHECKING:
    import casadi as ca

GAMMA = 1 - 1 / math.sqrt(2)


class LinearlyImplicit(Integrator):
    order = 2

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
        """x(t + h). Raises ValueError unless x has as many velocities as positions."""
        import casadi as ca  # here, as a scene is checked against the registry without equations

        q = list(positions)
        v = [i for i in range(x.numel()) if i not in set(q)]
        if len(q) != len(v):
            raise ValueError(
                f"linearly-implicit: {len(q)} positions but {len(v)} velocities; it takes q' = v"
            )
        symbols = [ca.SX.sym("symbol", given.numel()) for given in (x, u, p, t)]
        rate = ode(*symbols)[v]
        slopes = ca.Function(
            "slopes",
            symbols,
            [ca.jacobian(rate, symbols[0][q]), ca.jacobian(rate, symbols[0][v])],
            {"cse": True},
        )
        J_q, J_v = slopes(x, u, p, t)
        g = GAMMA * h
        A = ca.SX.eye(len(v)) - g * J_v - g**2 * J_q
        # QR needs no pivoting and hence no branch.
        factors = ca.qr(ca.densify(A))

        def solved(r: ca.SX) -> ca.SX:
            k_v = _back(factors, r[v] + g * J_q @ r[q])
            k = ca.SX(x.numel(), 1)
            k[v], k[q] = k_v, r[q] + g * k_v
            return k

        k1 = solved(ode(x, u, p, t))
        k2 = solved(ode(x + h * k1, u, p, t + h) - 2 * k1)
        return x + h * (1.5 * k1 + 0.5 * k2)


def _back(factors: tuple[ca.SX, ca.SX], b: ca.SX) -> ca.SX:
    """x with Q R x = b, by substitution."""
    import casadi as ca

    Q, R = factors
    y = Q.T @ b
    x: list[ca.SX] = [ca.SX(0)] * b.numel()
    for i in reversed(range(b.numel())):
        known = sum((R[i, j] * x[j] for j in range(i + 1, b.numel())), start=ca.SX(0))
        x[i] = (y[i] - known) / R[i, i]
    return ca.vertcat(*x)
