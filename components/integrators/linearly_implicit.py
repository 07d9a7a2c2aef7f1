"""ROS2, linearly implicit, order 2 and L-stable: for stiff springs, servos and contacts.

(1 - gamma h J) k_1 = f(t, x),   (1 - gamma h J) k_2 = f(t + h, x + h k_1) - 2 k_1
x_{k+1} = x_k + h (3 k_1 + k_2)/2,   gamma = 1 - 1/sqrt 2,   J = df/dx at (t, x)

Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20 (1999), 1456: order 2 with any J, so that
kinks of a force do not reduce the order. There is no iteration: two evaluations of f, one J by
algorithmic differentiation and one factorisation, without the positions q since q' = v. With
y = (v, further states) and v = P y:

(1 - gamma h J_yy - (gamma h)^2 J_yq P) k_y = r_y + gamma h J_yq r_q,   k_q = r_q + gamma h P k_y
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from hapticlink.components.integrators.base import Integrator, Ode

if TYPE_CHECKING:
    import casadi as ca

GAMMA = 1 - 1 / math.sqrt(2)


class LinearlyImplicit(Integrator):
    order = 2
    l_stable = True
    bounded_by = frozenset({"sticking"})

    def step(self, ode: Ode, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX, h: ca.SX) -> ca.SX:
        """x(t + h). Raises ValueError for more positions than velocities."""
        import casadi as ca  # here, as a scene is checked against the registry without equations

        q = list(ode.positions)
        y = [i for i in range(x.numel()) if i not in set(q)]
        if len(q) > len(y):
            raise ValueError(
                f"linearly-implicit: {len(q)} positions but {len(y)} velocities; it takes q' = v"
            )
        symbols = [ca.SX.sym("symbol", given.numel()) for given in (x, u, p, t)]
        rate = ode(*symbols)[y]
        both = [ca.jacobian(rate, symbols[0][of]) for of in (q, y)]
        J_q, J_y = ca.Function("slopes", symbols, both, {"cse": True})(x, u, p, t)
        g = GAMMA * h
        A = ca.SX.eye(len(y)) - g * J_y
        A[:, : len(q)] -= g**2 * J_q
        solve = _solver(A, _alone(J_y, len(q)))

        def solved(r: ca.SX) -> ca.SX:
            k_y = solve(r[y] + g * J_q @ r[q])
            k = ca.SX(x.numel(), 1)
            k[y], k[q] = k_y, r[q] + g * k_y[: len(q)]
            return k

        k1 = solved(ode(x, u, p, t))
        k2 = solved(ode(x + h * k1, u, p, t + h) - 2 * k1)
        return x + h * (1.5 * k1 + 0.5 * k2)


def _alone(J: ca.SX | ca.DM, first: int) -> list[int]:
    """The states from `first` on whose rates depend, of these, on themselves alone, as those of
    springs that slip do: such rates fall with their state, so that 1 - gamma h J is 1 or more."""
    import casadi as ca

    further = ca.Sparsity(J[first:, first:].sparsity())
    rows, columns = further.get_triplet()
    coupled = {i for i, j in zip(rows, columns, strict=True) if i != j}
    coupled |= {j for i, j in zip(rows, columns, strict=True) if i != j}
    return [first + i for i in range(further.size1()) if i not in coupled]


def _solver(A: ca.SX, alone: list[int]) -> Callable[[ca.SX], ca.SX]:
    """b -> x with A x = b. Unknowns that are `alone` are eliminated, so that the operations grow
    with their number and not with its cube: four boxes in an enclosure have 144 deflections."""
    import casadi as ca

    others = [i for i in range(A.size1()) if i not in set(alone)]
    own = ca.vertcat(ca.SX(0, 1), *(A[i, i] for i in alone))
    back = A[alone, others] / ca.repmat(own, 1, len(others))
    # QR needs no pivoting and hence no branch.
    reduced: ca.SX = A[others, others] - A[others, alone] @ back
    factors = ca.qr(ca.densify(reduced))

    def solved(b: ca.SX) -> ca.SX:
        x, of_own = ca.SX(b.numel(), 1), b[alone, 0] / own
        x[others] = _back(factors, b[others, 0] - A[others, alone] @ of_own)
        x[alone] = of_own - back @ x[others]
        return x

    return solved


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
