"""Semi-implicit (symplectic) Euler: velocities first, positions with the new velocities.

v_{k+1} = v_k + h f_v(q_k, v_k),   q_{k+1} = q_k + h f_q(q_k, v_{k+1})
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hapticlink.components.integrators.base import Baumgarte, Integrator, Ode

if TYPE_CHECKING:
    import casadi as ca


class SemiImplicitEuler(Integrator):
    order = 1
    baumgarte = Baumgarte(alpha_T=1.0, beta=0.5)

    def step(self, ode: Ode, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX, h: ca.SX) -> ca.SX:
        import casadi as ca  # here, as a scene is checked against the registry without equations

        positions = list(ode.positions)
        velocities = [i for i in range(x.numel()) if i not in set(positions)]
        after = ca.SX(x)
        after[velocities] = x[velocities] + h * ode(x, u, p, t)[velocities]
        after[positions] = x[positions] + h * ode(after, u, p, t)[positions]
        return after
