"""The passive midpoint method, order 2: a mechanism's step makes no energy of its own.

Of a mechanism, whose masses and closures it has to know, the step is that of
dynamics/passive_midpoint.py. Of equations x' = f without them it is the linearly implicit midpoint
rule, whose energy balance is exact for linear springs and dampers alone:

    (1 - h/2 J) k = f(t + h/2, x),   x_{k+1} = x_k + h k,   J = df/dx at (t + h/2, x)

Lee and Huang, IEEE Int. Conf. Robotics and Automation (2008); Kim, Lee, Lee and Lee, Int. J.
Robotics Research 36 (2017), doi 10.1177/0278364917731821.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hapticlink.components.integrators.base import Integrator

if TYPE_CHECKING:
    import casadi as ca


class PassiveMidpoint(Integrator):
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
        """x(t + h) of equations without a mass matrix."""
        import casadi as ca  # here, as a scene is checked against the registry without equations

        symbols = [ca.SX.sym("symbol", given.numel()) for given in (x, u, p, t)]
        rate = ode(*symbols)
        slope = ca.Function("slope", symbols, [rate, ca.jacobian(rate, symbols[0])], {"cse": True})
        f, J = slope(x, u, p, t + h / 2)
        return x + h * ca.solve(ca.SX.eye(x.numel()) - h / 2 * J, f)
