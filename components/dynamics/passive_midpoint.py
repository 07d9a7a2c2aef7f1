"""A step of a mechanism that makes no energy of its own: E_{k+1} - E_k <= F_k . (x_{k+1} - x_k).

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

for springs, dampers, friction and contacts, G(s) = Q(q_k + h s/2, s, t + h/2). The pivots of
D_m - h/2 G_s are at least those of D_m; they are anyway where G stiffens or dissipates.

What is left is of the order h^3: potentials that are not quadratic along the step, the correction
of closures, and E_pot where J_m s is not the displacement. It is accounted for exactly by `within`.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.dynamics.articulated_body import TreeInertia
from hapticlink.components.dynamics.closed_loop_solver import ClosedLoopSolver, MatrixInertia
from hapticlink.components.linkage.closures import rows
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Linkage, Mechanism

LEAST = 1e-200  # J
SHARE = 1e-6
"""Of the kinetic energy: a step that could keep less is not taken, since rounding of what is taken
away would show in what is left."""


def require_fitting(mechanism: Mechanism, linkage: Linkage, *, held: bool) -> None:
    """Raises ValueError for settings that the passive midpoint method does not fit; held: the
    matrices are inputs (local_model)."""
    if mechanism.integrator != "passive-midpoint":
        return
    name = '`mechanism.integrator` = "passive-midpoint"'
    if linkage.closed and mechanism.stabilization == "baumgarte":
        raise ValueError(
            f'{name}: Baumgarte\'s terms add energy; take `mechanism.stabilization` = "projection"'
        )
    if held:
        raise ValueError(f"{name} needs the matrices at its own pose: take `local_model` = false")


@dataclass(frozen=True)
class Applied:
    """The forces on a model, in its own symbols and x = (q, qd, further states), u, p, t.

    soft: generalised forces that depend on the motion; rigid: all others (n x 1); rates: of the
    further states; energy (J); places: displacements in which inputs do work; pushes: the inputs'
    efforts there, sign included; sources: generalised forces of drives, a part of soft.
    """

    soft: ca.SX
    rigid: ca.SX
    rates: ca.SX
    energy: ca.SX
    places: ca.SX
    pushes: ca.SX
    sources: ca.SX


def stops_output() -> Variable:
    text = "steps whose energy balance left only to stop the mechanism: the step is too long"
    return Variable("stops", (), "1", description=text)


class PassiveStep:
    """The step of a model under the forces `applied`; x, u, p and t are their symbols."""

    def __init__(
        self, model: LinkageModel, applied: Applied, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX
    ) -> None:
        self._n, once, q, qd = model.q.numel(), {"cse": True}, model.q, model.qd
        self._rates = ca.Function("rates", [x, u, p, t], [applied.rates], once)
        self._forces = ca.Function(
            "forces", [x, u, p, t], [applied.soft, applied.rigid, applied.sources], once
        )
        self._accounted = ca.Function(
            "accounted", [x, u, p, t], [applied.energy, model.kinetic_energy, applied.places], once
        )
        self._pushes = ca.Function("pushes", [u], [applied.pushes])
        self._drift = ca.Function("drift", [q, qd, p], [model.rate(applied.places)], once)
        self._velocities = ca.Function("velocities", [q, qd, p], [model.velocities], once)
        s, h = ca.SX.sym("s", self._n), ca.SX.sym("h")
        G, rigid, _ = self._forces(self._half(s, x, u, p, t, h), u, p, t + h / 2)
        slope = ca.jacobian(G, s)
        self._pull = ca.Function("pull", [s, x, u, p, t, h], [G + rigid, slope], once)
        self._soft = slope.nnz() > 0
        self._next = self._solver(model, p, soft=False)
        self._middle = self._solver(model, p, soft=True) if self._soft else self._next

    def _half(self, s: ca.SX, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX, h: ca.SX) -> ca.SX:
        """The state half a step on, with rates s."""
        there, further = x[: self._n] + h / 2 * s, x[2 * self._n :]
        rate = self._rates(ca.vertcat(there, s, further), u, p, t + h / 2)
        return ca.vertcat(there, s, further + h / 2 * rate)

    def _solver(self, model: LinkageModel, p: ca.SX, *, soft: bool) -> ca.Function:
        """(q, V, b, A, s) -> a with (D + A) a = J' M V + b + W' lambda, W (s + a) = 0 at q; A is
        empty unless `soft`."""
        n, V = self._n, ca.SX.sym("V", model.velocities.numel())
        b, s, A = ca.SX.sym("b", n), ca.SX.sym("s", n), ca.SX.sym("A", n * soft, n * soft)
        tree = TreeInertia(model)
        inertia = MatrixInertia(model.D + A, tree.k, model.leaf_to_root, tree.d) if soft else tree
        solver = ClosedLoopSolver(inertia, model.W, rows(model.linkage))
        a = solver.follow(model.momentum(V) + b, -model.W @ s)
        return ca.Function("solved", [model.q, V, b, A, s, p], [a], {"cse": True})

    def __call__(self, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX, h: ca.SX) -> tuple[ca.SX, ca.SX]:
        """x after h, before its closures are corrected, and h v_hat at the places."""
        n, none = self._n, ca.SX(0, 0)
        q, qd, further = x[:n], x[n : 2 * n], x[2 * n :]
        q_m, V = q + h / 2 * qd, self._velocities(q, qd, p)
        lag = V - self._velocities(q_m, qd, p)
        G, slope = self._pull(qd, x, u, p, t, h)
        A = -h / 4 * (slope + slope.T) if self._soft else none
        s = qd + self._middle(q_m, lag, h / 2 * G, A, qd, p)
        after = q + h * s
        rest = 2 * self._velocities(q_m, s, p) - V - self._velocities(after, s, p)
        qd = s + self._next(after, rest, ca.SX(n, 1), none, s, p)
        rate = self._rates(self._half(s, x, u, p, t, h), u, p, t + h / 2)
        return ca.vertcat(after, qd, further + h * rate), h * self._drift(q_m, s, p)

    def within(
        self, x: ca.SX, after: ca.SX, moved: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX, h: ca.SX
    ) -> tuple[ca.SX, ca.SX]:
        """`after`, with rates made smaller by the factor that the balance needs, and whether their
        whole energy does not suffice: the mechanism then stops at x instead. moved: h v_hat."""
        n = self._n
        before, _, at = self._accounted(x, u, p, t)
        energy, kinetic, there = self._accounted(after, u, p, t + h)
        mean = ca.vertcat(
            (x[:n] + after[:n]) / 2, moved[-n:] / h, (x[2 * n :] + after[2 * n :]) / 2
        )
        given = self._forces(mean, u, p, t + h / 2)[2]
        F = self._pushes(u)
        work = ca.fmin(ca.dot(F, there - at), ca.dot(F, moved)) + ca.dot(given, moved[-n:])
        excess = energy - before - work
        slower = ca.SX(after)
        share = 1 - excess / ca.fmax(kinetic, LEAST)
        slower[n : 2 * n] *= ca.sqrt(ca.fmin(ca.fmax(share, 0), 1))
        stopped = ca.SX(x)
        stopped[n : 2 * n] = 0
        stops = share < SHARE
        return ca.if_else(stops, stopped, slower), stops
