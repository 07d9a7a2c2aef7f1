"""The step of the virtual mechanism, as integration methods see it (`MechanicalSystem`)."""

from __future__ import annotations

import logging
from functools import cached_property

import casadi as ca

from hapticlink.components import forces, integrators, time_signals
from hapticlink.components.component import Block
from hapticlink.components.contact import located_events
from hapticlink.components.contact.kept_sides import NAME
from hapticlink.components.contact.located_events import LocatedEvents
from hapticlink.components.contact.one_sided_spring import OneSidedForces
from hapticlink.components.dynamics import further_points, grasp, joint_ports
from hapticlink.components.dynamics.articulated_body import TreeInertia
from hapticlink.components.dynamics.closed_loop_solver import (
    ClosedLoopSolver,
    Inertia,
    MatrixInertia,
)
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.projection import projection
from hapticlink.components.dynamics.redundant_closures import (
    is_overconstrained,
    least_pivot,
    nearest_closed,
)
from hapticlink.components.forces import friction, gravity
from hapticlink.components.integrators.base import Integrator, MechanicalSystem
from hapticlink.components.linkage.model import same_point
from hapticlink.components.specs.linkage import Mechanism
from hapticlink.components.time_signals import TimeSignal

DEFLECTIONS = ("deflection", "contact_deflection")
"""The states of friction: of joints, and of contacts."""

MANY, MOST = 250_000, 5_000_000
"""Operations of a step from which on the build takes minutes, and those that no build may have: 87
bytes each in a Python FMU, which may have 1 GiB when it is unpacked."""
EVALUATIONS = 6
"""Evaluations of the equations of motion to which a step of a method comes, its event functions and
Jacobian counted in these: 5.0 to 6.6 with one to four boxes in an enclosure, 8.4 with friction."""

_ONCE = {"cse": True}


class MechanismSteps(MechanicalSystem):
    """The mechanism in the symbols of its block.

    applied: generalised forces (n x 1) of hands, couplings and motors outside; touching: the
    contacts and joint limits, if there are any; energy: kinetic and potential (J); signals: those
    of drives over time, which are known within a step; kept_sides: of contacts, for the whole
    step, and held_point: of the hand, each in the place of the state.
    """

    def __init__(
        self,
        block: Block,
        mechanism: Mechanism,
        space: OperationalSpace,
        applied: ca.SX,
        touching: OneSidedForces | None,
        energy: ca.SX,
        signals: list[TimeSignal],
        *,
        kept_sides: ca.SX | None = None,
        held_point: ca.SX | None = None,
    ) -> None:
        self._block, self._mechanism, self._space = block, mechanism, space
        self._applied, self._touching, self._energy = applied, touching, energy
        self._model = space.model
        further = [block.x[name] for name in DEFLECTIONS if name in block.x]
        self.x = ca.vertcat(self._model.q, self._model.qd, *further)
        self.p, self.t, self.h, self.n = block.p.vector, block.t, block.h, self._model.q.numel()
        self._symbols = self.u = block.u.vector
        self._now = None
        if signals:
            over = ca.SX.sym("over", time_signals.size_over(signals))
            self._now = time_signals.within(signals, over, block.t)
            self._symbols = ca.vertcat(self.u, over)
            self.u = ca.vertcat(self.u, time_signals.over(signals, block.t, block.h))
        if kept_sides is not None:
            self._symbols = ca.vertcat(self._symbols, ca.vec(block.x[NAME].T))
            self.u = ca.vertcat(self.u, ca.vec(kept_sides.T))
        if held_point is not None:
            self._symbols = ca.vertcat(self._symbols, block.x[grasp.HELD])
            self.u = ca.vertcat(self.u, held_point)

    def _known(self, expression: ca.SX) -> ca.SX:
        """An expression of the signals' values at an instant in terms of what is known of them
        within the step, a part of the inputs."""
        if self._now is None:
            return expression
        return ca.substitute(expression, self._model.tabled, self._now)

    # --- the equations of motion ----------------------------------------------------------

    def integrated(self, method: Integrator) -> ca.SX:
        model, touching, terms = self._model, self._touching, self._space.terms
        x, u, p, t = self.x, self._symbols, self.p, self.t
        efforts = self._known(terms.efforts + self._applied)
        rates = friction.deflection_rates(model)
        if touching:
            laws = None
            if self._mechanism.events and method.order > 1:
                laws = ca.SX.sym("laws", len(touching.sides))
                located = located_events.functions(touching.sides, x, u, p)
                method = LocatedEvents(method, self._mechanism.events, located)
                u = ca.vertcat(laws, u)
            efforts += touching.efforts(laws)
            rates = ca.vertcat(rates, touching.state_rates(laws))
        closing = -terms.w
        if model.linkage.closed and self._mechanism.stabilization == "baumgarte":
            alpha, beta = self._block.p["alpha"], self._block.p["beta"]
            closing -= 2 * alpha * beta * model.rate(model.h) + alpha**2 * model.h
        qdd = self._space.solver.follow(efforts, closing, refined=method.extrapolates)
        ode = ca.Function("ode", [x, u, p, t], [ca.vertcat(model.qd, qdd, rates)], _ONCE)
        if self._nearest is not None:
            at = ca.vertcat(self._nearest(model.q, p), x[self.n :])
            ode = ca.Function("nearest", [x, u, p, t], [ode(at, u, p, t)], _ONCE)
        if touching:
            self._require_buildable(ode.n_instructions(), len(touching.sides))
        return self.projected(integrators.step(method, ode, x, self.u, p, t, self.h, range(self.n)))

    def _require_buildable(self, operations: int, places: int) -> None:
        """operations: of the equations of motion. Logs a step that comes to MANY operations, before
        it is built. Raises ValueError for more than MOST."""
        steps, bodies = 2 * self._mechanism.events + 1, self._model.linkage.body
        about = EVALUATIONS * steps * operations
        if about < MANY:
            return
        message = (
            f"{len(bodies)} bodies with {places} places where contacts and joint limits push: "
            f"{operations:,} operations for their accelerations, about {about:,} for a step "
            f"with `mechanism.integrator` = '{self._mechanism.integrator}' and "
            f"`mechanism.events` = {self._mechanism.events} ({steps} steps in one)"
        )
        remedy = (
            "fewer: `mechanism.events` = 0, `contacts.bodies` = 'none', no `contacts.friction`, "
            "bodies with fewer corners or a `radius` alone"
        )
        if about > MOST:
            raise ValueError(f"{message}, more than {MOST:,}; {remedy}")
        logging.getLogger(__name__).warning("%s, which takes minutes to build; %s", message, remedy)

    def projected(self, x: ca.SX) -> ca.SX:
        if self._mechanism.stabilization != "projection":
            return x
        n, inertia = self.n, self._space.terms.inertia
        own = inertia if isinstance(inertia, TreeInertia) else TreeInertia(self._model)
        q, qd = projection(self._model, own)(x[:n], x[n : 2 * n], self.p)
        return ca.vertcat(q, qd, x[2 * n :])

    # --- the terms of (B.6), for methods that use more than the equations of motion -------

    def _function(self, name: str, *results: ca.SX) -> ca.Function:
        """(x, u, p, t) -> results."""
        return ca.Function(name, [self.x, self._symbols, self.p, self.t], [*results], _ONCE)

    @cached_property
    def _further_points(self) -> list[further_points.Pushed]:
        return further_points.forces_at_points(self._model, self._block.u)

    @cached_property
    def _hands(self) -> list[tuple[ca.SX, ca.SX]]:
        """Pose of the operational point and wrench on it, of each that the hand can hold."""
        model, wrench = self._model, self._block.u["F_hand"] - self._block.u["F_drift"]
        if model.point is None:
            return [(model.x_h, wrench)]
        choices = [ca.SX(k + 1) for k in range(len(model.linkage.choices))]
        return [
            (model.pose_of_choice(k), ca.if_else(same_point(model.point, k), wrench, 0))
            for k in choices
        ]

    @cached_property
    def _displacements(self) -> ca.SX:
        further = (point.x for point in self._further_points)
        return ca.vertcat(*(x for x, _ in self._hands), *further, self._model.q)

    @cached_property
    def rates(self) -> ca.Function:
        rates = friction.deflection_rates(self._model)
        if self._touching:
            rates = ca.vertcat(rates, self._touching.state_rates())
        return self._function("rates", rates)

    @cached_property
    def forces(self) -> ca.Function:
        weight = gravity.efforts(self._model)
        soft = forces.efforts(self._model, weight=False)
        if self._touching:
            soft += self._touching.efforts()
        rigid = self._applied if weight is None else self._applied + weight
        drives = forces.sources(self._model)
        return self._function("forces", *map(self._known, (soft, rigid, drives)))

    @cached_property
    def energies(self) -> ca.Function:
        results = self._known(self._energy), self._model.kinetic_energy, self._displacements
        return self._function("energies", *results)

    @cached_property
    def input_efforts(self) -> ca.Function:
        u = self._block.u
        wrenches = [wrench for _, wrench in self._hands]
        further = (point.wrench for point in self._further_points)
        efforts = ca.vertcat(*wrenches, *further, joint_ports.efforts(self._model, u))
        return ca.Function("input_efforts", [self._symbols], [efforts])

    def _kinematics(self, name: str, result: ca.SX) -> ca.Function:
        """(q, qd, p) -> result."""
        return ca.Function(name, [self._model.q, self._model.qd, self.p], [result], _ONCE)

    @cached_property
    def displacement_rates(self) -> ca.Function:
        return self._kinematics("displacement_rates", self._model.rate(self._displacements))

    @cached_property
    def velocities(self) -> ca.Function:
        return self._kinematics("velocities", self._model.velocities)

    def constrained_solver(self, *, softened: bool) -> ca.Function:
        model, n = self._model, self.n
        V, b, s = (
            ca.SX.sym(name, size)
            for name, size in (("V", model.velocities.numel()), ("b", n), ("s", n))
        )
        A = ca.SX.sym("A", n * softened, n * softened)
        tree = TreeInertia(model)
        inertia: Inertia = tree
        if softened:
            inertia = MatrixInertia(model.D + A, tree.k, model.leaf_to_root, tree.d)
        pivot = least_pivot(model.linkage)
        solver = ClosedLoopSolver(inertia, model.W, model.rows, pivot=pivot)
        a = solver.follow(model.momentum(V) + b, -model.W @ s)
        solved = ca.Function("solved", [model.q, V, b, A, s, self.p], [a], _ONCE)
        if self._nearest is None:
            return solved
        at = self._nearest(model.q, self.p)
        a = solved(at, V, b, A, s, self.p)
        return ca.Function("nearest", [model.q, V, b, A, s, self.p], [a], _ONCE)

    @cached_property
    def _nearest(self) -> ca.Function | None:
        """(q, p) -> the closed pose at which accelerations are solved, None where at q itself."""
        return nearest_closed(self._model) if is_overconstrained(self._model.linkage) else None
