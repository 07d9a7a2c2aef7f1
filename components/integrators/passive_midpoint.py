"""The passive midpoint method, order 2: a mechanism's step makes no energy of its own,

    E_{k+1} - E_k <= F_k . (x_{k+1} - x_k).

V = J(q) qd are the velocities of all bodies, whose inertia M is constant, so that E_kin = V' M V/2
needs no Coriolis terms. With the pose q_m = q_k + h qd_k/2 half a step on, J_m = J(q_m) and
W_m = W(q_m):

    J_m' M (V+ - V_k)/h = G(s) + W_m' lambda,   W_m s = 0,   (V+ + V_k)/2 = J_m s       midpoint
    q_{k+1} = q_k + h s
    D qd_{k+1} = J' M V+ + W' lambda,   W qd_{k+1} = 0   at q_{k+1}                     next pose

The first line gives E_kin(V+) - E_kin(V_k) = h s' G exactly, for any h: the constraints and the
velocities themselves do no work (Kim, Lee, Lee and Lee, Int. J. Robotics Research 36 (2017), doi
10.1177/0278364917731821; varying steps: Lee and Huang, ICRA 2008). The last line is the orthogonal
projection, in the metric M, of V+ on the velocities that joints and loops allow at q_{k+1}, which
never adds to E_kin. There is no iteration: G is linear in s about qd_k,

    (D_m - h/2 G_s) (s - qd_k) = J_m' M (V_k - J_m qd_k) + h/2 G(qd_k) + W_m' lambda

for springs, dampers, friction and contacts, G(s) = Q(q_k + h s/2, s, t + h/2), solved with the
symmetric part of G_s, whose factors have pivots of at least those of D_m (they have anyway where G
stiffens or dissipates), and once more with the other part's forces at the rates found: friction
grows with the pressure of its contact, which does not grow with friction.

What is left is of the order h^3: potentials that are not quadratic along the step, the correction
of closures, and E_pot where J_m s is not the displacement. It is accounted for exactly by
`_balance`.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from hapticlink.components.integrators.base import Integrator, MechanicalSystem, Ode

if TYPE_CHECKING:
    import casadi as ca

LEAST_ENERGY = 1e-200  # J
LEAST_SHARE = 1e-6
"""Of the kinetic energy: a step that could keep less is not taken, since rounding of what is taken
away would show in what is left."""
STOPS = "steps whose energy balance left only to stop the mechanism: the step is too long"


class PassiveMidpoint(Integrator):
    order = 2
    bounded_by = frozenset()
    counters = MappingProxyType({"stops": STOPS})

    def misfit(self, *, baumgarte: bool, held: bool) -> str:
        if baumgarte:
            return 'Baumgarte\'s terms add energy; take `mechanism.stabilization` = "projection"'
        needed = "it needs the matrices at its own pose; take `local_model` = false"
        return needed if held else ""

    def step(self, ode: Ode, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX, h: ca.SX) -> ca.SX:
        """x(t + h) of equations without a mass matrix, by the linearly implicit midpoint rule,
        whose energy balance is exact for linear springs and dampers alone:

        (1 - h/2 J) k = f(t + h/2, x),   x_{k+1} = x_k + h k,   J = df/dx at (t + h/2, x)
        """
        import casadi as ca  # here, as a scene is checked against the registry without equations

        symbols = [ca.SX.sym("symbol", given.numel()) for given in (x, u, p, t)]
        rate = ode(*symbols)
        slope = ca.Function("slope", symbols, [rate, ca.jacobian(rate, symbols[0])], {"cse": True})
        f, J = slope(x, u, p, t + h / 2)
        return x + h * ca.solve(ca.SX.eye(x.numel()) - h / 2 * J, f)

    def mechanism_step(self, mechanism: MechanicalSystem) -> ca.SX:
        import casadi as ca

        after, moved = _advance(mechanism)
        after, stops = _balance(mechanism, mechanism.projected(after), moved)
        return ca.vertcat(after, stops)


def _advance(m: MechanicalSystem) -> tuple[ca.SX, ca.SX]:
    """x(t + h) before its closures are corrected, and the displacements h r' at the rates s."""
    import casadi as ca

    n, x, u, p, t, h = m.n, m.x, m.u, m.p, m.t, m.h
    q, qd, z = x[:n], x[n : 2 * n], x[2 * n :]
    pull, is_soft = _linear_forces(m)
    next_pose = m.constrained_solver(softened=False)
    midpoint = m.constrained_solver(softened=True) if is_soft else next_pose
    q_m, V, none = q + h / 2 * qd, m.velocities(q, qd, p), ca.SX(0, 0)
    lag = V - m.velocities(q_m, qd, p)
    G, slope = pull(qd, x, u, p, t, h)
    A = -h / 4 * (slope + slope.T) if is_soft else none
    s = qd + midpoint(q_m, lag, h / 2 * G, A, qd, p)
    if is_soft:
        G += (slope - slope.T) / 2 @ (s - qd)
        s = qd + midpoint(q_m, lag, h / 2 * G, A, qd, p)
    after = q + h * s
    left = 2 * m.velocities(q_m, s, p) - V - m.velocities(after, s, p)
    qd = s + next_pose(after, left, ca.SX(n, 1), none, s, p)
    rate = m.rates(_half(m, s, x, u, p, t, h), u, p, t + h / 2)
    return ca.vertcat(after, qd, z + h * rate), h * m.displacement_rates(q_m, s, p)


def _half(m: MechanicalSystem, s: ca.SX, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX, h: ca.SX) -> ca.SX:
    """The state half a step on, with rates s."""
    import casadi as ca

    q, z = x[: m.n] + h / 2 * s, x[2 * m.n :]
    rate = m.rates(ca.vertcat(q, s, z), u, p, t + h / 2)
    return ca.vertcat(q, s, z + h / 2 * rate)


def _linear_forces(m: MechanicalSystem) -> tuple[ca.Function, bool]:
    """(s, x, u, p, t, h) -> (G(s), G_s), and whether G depends on s."""
    import casadi as ca

    x, p, t, u = m.x, m.p, m.t, ca.SX.sym("u", m.u.numel())
    s, h = ca.SX.sym("s", m.n), ca.SX.sym("h")
    G, rigid, _ = m.forces(_half(m, s, x, u, p, t, h), u, p, t + h / 2)
    slope = ca.jacobian(G, s)
    pull = ca.Function("pull", [s, x, u, p, t, h], [G + rigid, slope], {"cse": True})
    return pull, slope.nnz() > 0


def _balance(m: MechanicalSystem, after: ca.SX, moved: ca.SX) -> tuple[ca.SX, ca.SX]:
    """`after`, with rates made smaller by the factor that the balance needs, and whether their
    whole energy does not suffice: the mechanism then stops at x instead."""
    import casadi as ca

    n, x, u, p, t, h = m.n, m.x, m.u, m.p, m.t, m.h
    energy_before, _, r_before = m.energies(x, u, p, t)
    energy, kinetic, r = m.energies(after, u, p, t + h)
    mean = ca.vertcat((x[:n] + after[:n]) / 2, moved[-n:] / h, (x[2 * n :] + after[2 * n :]) / 2)
    driven = m.forces(mean, u, p, t + h / 2)[2]
    F = m.input_efforts(u)
    work = ca.fmin(ca.dot(F, r - r_before), ca.dot(F, moved)) + ca.dot(driven, moved[-n:])
    excess = energy - energy_before - work
    slower = ca.SX(after)
    share = 1 - excess / ca.fmax(kinetic, LEAST_ENERGY)
    slower[n : 2 * n] *= ca.sqrt(ca.fmin(ca.fmax(share, 0), 1))
    stopped = ca.SX(x)
    stopped[n : 2 * n] = 0
    stops = share < LEAST_SHARE
    return ca.if_else(stops, stopped, slower), stops
