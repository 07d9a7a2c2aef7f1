"""The step of the virtual mechanism: (q, qd, deflections) after h."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from hapticlink.components import forces, integrators, time_signals
from hapticlink.components.component import Block
from hapticlink.components.contact import located_events
from hapticlink.components.contact.located_events import LocatedEvents
from hapticlink.components.contact.unilateral import OneSidedForces
from hapticlink.components.dynamics import further_points, joint_ports
from hapticlink.components.dynamics.articulated_body import TreeInertia
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.passive_midpoint import Applied, PassiveStep
from hapticlink.components.dynamics.projection import projection
from hapticlink.components.forces import friction, gravity
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Mechanism
from hapticlink.components.time_signals import TimeSignal

DEFLECTIONS = ("deflection", "contact_deflection")
"""The states of friction: of joints, and of contacts."""


@dataclass(frozen=True)
class MechanismSteps:
    """applied: generalised forces (n x 1) of hands, couplings and motors outside; touching: the
    contacts and joint limits, if there are any; signals: those of drives over time."""

    block: Block
    model: LinkageModel
    mechanism: Mechanism
    applied: ca.SX
    touching: OneSidedForces | None
    signals: list[TimeSignal]

    @property
    def _state(self) -> ca.SX:
        further = [self.block.x[name] for name in DEFLECTIONS if name in self.block.x]
        return ca.vertcat(self.model.q, self.model.qd, *further)

    def _over(self, found: list[ca.SX]) -> tuple[list[ca.SX], ca.SX, ca.SX]:
        """`found` as functions of inputs u that are constant over the step, these u, and what they
        are in it: the block's own inputs, and what is known of the signals."""
        block, u = self.block, self.block.u.vector
        if not self.signals:
            return found, u, u
        over = ca.SX.sym("over", time_signals.size_over(self.signals))
        now = time_signals.within(self.signals, over, block.t)
        found = [ca.substitute(each, self.model.tabled, now) for each in found]
        known = time_signals.over(self.signals, block.t, block.h)
        return found, ca.vertcat(u, over), ca.vertcat(u, known)

    def integrated(self, space: OperationalSpace) -> ca.SX:
        """By integration of the stabilised equations, followed by projection if chosen."""
        block, model, mechanism, touching = self.block, self.model, self.mechanism, self.touching
        n, x, p, t = model.q.numel(), self._state, block.p.vector, block.t
        (efforts,), u, given = self._over([space.terms.efforts + self.applied])
        integrator = integrators.METHODS[mechanism.integrator]
        rates = friction.deflection_rates(model)
        if touching:
            laws = None
            if mechanism.events and integrator.order > 1:
                laws = ca.SX.sym("laws", len(touching.sides))
                located = located_events.functions(touching.sides, x, u, p)
                integrator = LocatedEvents(integrator, mechanism.events, located)
                u = ca.vertcat(laws, u)
            efforts += touching.efforts(laws)
            rates = ca.vertcat(rates, touching.state_rates(laws))
        closing = -space.terms.w
        if model.linkage.closed and mechanism.stabilization == "baumgarte":
            alpha, beta = block.p["alpha"], block.p["beta"]
            closing -= 2 * alpha * beta * model.rate(model.h) + alpha**2 * model.h
        qdd = space.solver.follow(efforts, closing, refined=integrator.extrapolates)
        ode = ca.Function("ode", [x, u, p, t], [ca.vertcat(model.qd, qdd, rates)], {"cse": True})
        after = integrators.step(integrator, ode, x, given, p, t, block.h, range(n))
        inertia = space.terms.inertia
        own = inertia if isinstance(inertia, TreeInertia) else TreeInertia(model)
        return self._projected(after, own)

    def passive(self, energy: ca.SX) -> ca.SX:
        """By the passive midpoint method, with the number of stops; energy (J)."""
        block, model, touching = self.block, self.model, self.touching
        x, p, t = self._state, block.p.vector, block.t
        points = further_points.pushed(model, block.u)
        places = ca.vertcat(model.x_h, *(point.x for point in points), model.q)
        drawn = block.u["F_hand"] - block.u["F_drift"]
        pushes = [drawn, *(point.wrench for point in points), joint_ports.efforts(model, block.u)]
        rates = friction.deflection_rates(model)
        weight = gravity.efforts(model)
        soft = forces.efforts(model, weight=False) + (touching.efforts() if touching else 0)
        found = [
            soft,
            self.applied if weight is None else self.applied + weight,
            ca.vertcat(rates, touching.state_rates()) if touching else rates,
            energy,
            places,
            ca.vertcat(*pushes),
            forces.sources(model),
        ]
        found, u, given = self._over(found)
        step = PassiveStep(model, Applied(*found), x, u, p, t)
        after, moved = step(x, given, p, t, block.h)
        after = self._projected(after, TreeInertia(model))
        after, stops = step.within(x, after, moved, given, p, t, block.h)
        return ca.vertcat(after, block.x["stops"] + stops)

    def _projected(self, after: ca.SX, inertia: TreeInertia) -> ca.SX:
        """`after` on the closures, if the scene chooses projection; inertia: the model's own."""
        n = self.model.q.numel()
        if self.mechanism.stabilization == "projection":
            project = projection(self.model, inertia)
            q, qd = project(after[:n], after[n : 2 * n], self.block.p.vector)
            after[: 2 * n] = ca.vertcat(q, qd)
        return after
