"""Steps that end where a contact begins or ends and go on from there, so that the integration
method keeps its order away from grazing.

    1. trial    x' = f(x; m) over the rest of the step, with the contacts m that push now
    2. root     the first contact whose event function e changes its sign in the trial, by inverse
                cubic interpolation of (e, e') at both ends: e = g before it touches, e = s while it
                pushes, e = -s after it has let go
    3. to root  x' = f(x; m) up to there, corrected by a Newton step -e/e', of the size of h^4
    4. m        of this contact changes, and of those that change with it

1 to 4 are repeated `events` times; what is left of the step follows f with the forces as the state
says. So there is a fixed number of evaluations, 2 steps and 2 evaluations for each event and one
step, whether events happen or not. A further event in the same step, a grazing contact, which
begins and ends within one, and a contact that changes its place cost accuracy as without location:
O(h^2), or O(h) for the velocity where damping makes the force jump.

Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (1993), section II.6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from hapticlink.components import integrators
from hapticlink.components.contact.one_sided_spring import BEGUN, BY_STATE, Unilateral
from hapticlink.components.integrators.base import Integrator, Ode

STEEP = 1 / 3  # of the mean slope of e, at either end: inverse interpolation is monotonic
TOGETHER = 1e-9  # of a step: events that are not further apart happen at once
CORRECTION = 0.1  # of a step: the largest Newton step


class LocatedEvents(Integrator):
    """An integration method that locates so many `events` in each step.

    functions: (x, x', u, p) -> (pushes, g, s, g', s') of k contacts, each k x 1 (`functions`). A
    step takes an ode (x, (laws, u), p, t) -> x' with the laws of the contacts
    (one_sided_spring.py).
    """

    def __init__(self, method: Integrator, events: int, functions: ca.Function) -> None:
        self.method, self.events, self.functions = method, events, functions
        self.order, self.extrapolates = method.order, method.extrapolates

    def step(self, ode: Ode, x: ca.SX, u: ca.SX, p: ca.SX, t: ca.SX, h: ca.SX) -> ca.SX:
        """x(t + h)."""

        def stepped(x: ca.SX, laws: ca.SX, t: ca.SX, h: ca.SX) -> ca.SX:
            given = ca.vertcat(laws, u)
            rate, q = ode.rate, ode.positions
            return integrators.step(self.method, rate, x, given, p, t, h, q)

        def evaluated(x: ca.SX, pushing: ca.SX, t: ca.SX) -> tuple[ca.SX, _Contacts]:
            rate = ode(x, ca.vertcat(pushing, u), p, t)
            return rate, _Contacts(*self.functions(x, rate, u, p))

        pushing, *_ = self.functions(x, ca.SX(x.numel(), 1), u, p)
        begun, left = ca.SX.zeros(pushing.numel()), h
        for _ in range(self.events):
            trial = stepped(x, pushing, t, left)
            _, before = evaluated(x, pushing, t)
            _, after = evaluated(trial, pushing, t + left)
            was_apart = before.gap >= 0
            start, end = before.event(pushing, was_apart), after.event(pushing, was_apart)
            changes = after.pushing != pushing
            crossed = ca.logic_and(changes, ca.logic_and(start.value >= 0, end.value < 0))
            share = ca.if_else(crossed, _root(start, end, left), 1 - changes)
            first = ca.mmin(share)
            x = stepped(x, pushing, t, first * left)
            rate, there = evaluated(x, pushing, t + first * left)
            now = ca.logic_and(crossed, share <= first + TOGETHER)
            delay = _newton(there.event(pushing, was_apart), now, first, left)
            x += delay * rate
            t += first * left + delay
            left = (1 - first) * left - delay
            pushing = ca.if_else(now, 1 - pushing, pushing)
            begun = ca.logic_and(pushing, ca.logic_or(now, begun))
        return stepped(x, ca.if_else(begun, BEGUN, BY_STATE), t, left)


def functions(sides: Sequence[Unilateral], x: ca.SX, u: ca.SX, p: ca.SX) -> ca.Function:
    """The event functions of contacts at states x, with inputs u and parameters p."""
    columns = zip(*((side.pushes, side.gap, side.push) for side in sides), strict=True)
    pushing, gap, push = (ca.vertcat(*column) for column in columns)
    xdot = ca.SX.sym("xdot", x.numel())
    rates = ca.vertsplit(ca.jtimes(ca.vertcat(gap, push), x, xdot), gap.numel())
    return ca.Function("events", [x, xdot, u, p], [pushing, gap, push, *rates], {"cse": True})


@dataclass(frozen=True)
class _Event:
    """An event function e and its rate, k x 1."""

    value: ca.SX
    rate: ca.SX


@dataclass(frozen=True)
class _Contacts:
    """Whether contacts push, their g and s, and the rates of these, k x 1."""

    pushing: ca.SX
    gap: ca.SX
    push: ca.SX
    gap_rate: ca.SX
    push_rate: ca.SX

    def event(self, pushing: ca.SX, was_apart: ca.SX) -> _Event:
        """e for contacts that were `pushing` or apart when the step began."""

        def chosen(push: ca.SX, gap: ca.SX) -> ca.SX:
            return ca.if_else(pushing, push, ca.if_else(was_apart, gap, -push))

        return _Event(chosen(self.push, self.gap), chosen(self.push_rate, self.gap_rate))


def _root(start: _Event, end: _Event, h: ca.SX) -> ca.SX:
    """The share of the step at which e = 0, from e >= 0 to e < 0: time as a cubic of e; a straight
    line where e is not steep."""
    fall = start.value - end.value
    y, slopes = start.value / fall, [-side.rate * h / fall for side in (start, end)]
    steep = ca.logic_and(slopes[0] > STEEP, slopes[1] > STEEP)
    a, b = (ca.if_else(steep, 1 / slope, 1) for slope in slopes)
    cubic = y * (y * (3 - 2 * y) + (1 - y) * ((1 - y) * a - y * b))
    return ca.fmin(ca.fmax(cubic, 0), 1)


def _newton(event: _Event, now: ca.SX, first: ca.SX, h: ca.SX) -> ca.SX:
    """Time (s) from the share `first` of a step of h to the mean root of the events that are
    `now`, within the step."""
    steps = ca.if_else(ca.logic_and(now, event.rate < 0), -event.value / event.rate, 0)
    mean = ca.sum1(steps) / ca.fmax(ca.sum1(now), 1)
    least, most = ca.fmax(-CORRECTION, -first) * h, ca.fmin(CORRECTION, 1 - first) * h
    return ca.fmin(ca.fmax(mean, least), most)
