"""Penalty contact of bodies that never pulls (k_contact, b_contact of section B.6).

    g  = n . (x - x_plane) - r,   g' = n . v          gap (m) and its rate at the contact point
    F  = n max(0, -k g - b g')  where g < 0, else 0   (one_sided_spring.py)
    Q  = sum_i J_i' F_i

F acts on the point of the body's surface that has the velocity v relative to the other body, or to
the ground, on which -F acts at the same point of the world: between bodies, momentum and angular
momentum are conserved.

With a coefficient of friction mu, F also has the tangential part -k e of forces/friction.py, with
the rate of the body's surface along the plane, the spring of stiffness k with its deflection z as a
state, and a limit k d = mu n . F.
"""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import Signals, Variable
from hapticlink.components.contact.broad_phase import near
from hapticlink.components.contact.detection import (
    COLUMNS,
    Ahead,
    Touch,
    obstacle_parameters,
    shape_parameters,
    touches,
)
from hapticlink.components.contact.one_sided_spring import OneSidedForces, Unilateral
from hapticlink.components.forces import friction
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Linkage

FAR = 1e9  # m


def places(linkage: Linkage, contacts: Contacts) -> int:
    """Number of potential contact places of all pairs."""
    return sum(pair.places for pair in near(linkage, contacts))


def contact_port(linkage: Linkage, contacts: Contacts) -> Variable:
    """The port for the contact geometry from the virtual environment to the mechanism, one row per
    place."""
    rows = places(linkage, contacts)
    text = "one row a place: active, point in the body, point and normal of the other's plane"
    return Variable("contacts", (rows, len(COLUMNS)), COLUMNS, description=text, kind="table")


def contact_parameters(linkage: Linkage, contacts: Contacts) -> list[Variable]:
    """Parameters of the block that evaluates the contact forces."""
    laws = (
        ("k_contact", "N/m", contacts.stiffness, "stiffness of a contact"),
        ("b_contact", "N.s/m", contacts.damping, "damping of a contact"),
        ("mu_contact", "1", contacts.friction, "friction of a contact"),
    )
    return [
        *detection_parameters(linkage, contacts, contacts.detection == "haptics"),
        *(Variable(name, (), unit, v, text) for name, unit, v, text in laws if v is not None),
    ]


def lag(h: ca.SX) -> ca.SX:
    """tau (s), damping over stiffness of a contact that sticks, for integration steps of h."""
    return friction.LAG * h


def states(linkage: Linkage, contacts: Contacts) -> list[Variable]:
    """The tangential deflections of the places, with friction."""
    if contacts.friction is None:
        return []
    return [Variable("contact_deflection", (places(linkage, contacts),), "m")]


def detection_parameters(
    linkage: Linkage, contacts: Contacts, obstacles: bool = True
) -> list[Variable]:
    """Radii of the links, and the obstacles in the block that detects contacts."""
    radii = {b.name: b.radius or 0.0 for b in linkage.body}
    variables = shape_parameters(near(linkage, contacts), radii)
    return variables + (obstacle_parameters(contacts) if obstacles else [])


def gap_output() -> Variable:
    text = "smallest gap of an active contact"
    return Variable("contact_gap", (), "m", description=text)


def gap(model: LinkageModel, touch: Touch) -> ca.SX:
    """Gap g (m)."""
    point = model.frames[touch.body].point(touch.point)
    return ca.dot(touch.normal, point - touch.plane) - model.p[f"{touch.body}.radius"]


def detect_contacts(
    model: LinkageModel, contacts: Contacts, kept: ca.SX | None, frame_s: ca.SX
) -> ca.SX:
    """The rows of the `contacts` port at the model's pose, for the two frames of frame_s (s) until
    they are replaced: one in which they are computed, and one in which they are held. kept: as of
    `touches`."""
    rows = []
    for touch in touches(model, contacts, model.p, kept, Ahead(2 * frame_s, contacts.margin)):
        other = model.frames[touch.other]
        plane = ca.vertcat(other.local(touch.plane), other.rotation.T @ touch.normal)
        rows.append(ca.vertcat(touch.active, touch.point, plane).T)
    return ca.vertcat(*rows)


def held_contacts(model: LinkageModel, contacts: Contacts, rows: ca.SX) -> list[Touch]:
    """The places given by the rows of the `contacts` port, whose planes move with their bodies."""
    touching = []
    pairs = [pair for pair in near(model.linkage, contacts) for _ in range(pair.places)]
    for pair, row in zip(pairs, ca.vertsplit(rows), strict=True):
        name = pair.obstacle if pair.kind == "body" else "ground"
        other = model.frames[name]
        plane, normal = other.point(row[3:5].T), other.rotation @ row[5:7].T
        touching.append(Touch(pair.body, name, row[0] > 0.5, row[1:3].T, plane, normal))
    return touching


class ContactForces(OneSidedForces):
    """The forces of all contacts at the model's pose and velocity, acting on the points of the
    bodies' surfaces as material points. deflection: that of each place, with friction. gap (m): the
    smallest one."""

    def __init__(
        self,
        model: LinkageModel,
        contacts: Contacts,
        p: Signals,
        touching: list[Touch],
        deflection: ca.SX | None = None,
    ) -> None:
        self._model, self._p, self._touches, self._z = model, p, touching, deflection
        self._arms: list[dict[str, ca.SX]] = []
        slides: list[ca.SX] = []
        self.sides = []
        for touch in touching:
            frame, other = model.frames[touch.body], model.frames[touch.other]
            arm = frame.rotation @ touch.point - model.p[f"{touch.body}.radius"] * touch.normal
            arms = {touch.body: arm, touch.other: frame.origin + arm - other.origin}
            v = self._velocity(touch.body, arm) - self._velocity(touch.other, arms[touch.other])
            rate, damped = ca.dot(touch.normal, v), (p["k_contact"], p["b_contact"])
            self.sides.append(Unilateral(gap(model, touch), rate, *damped, touch.active))
            self._arms.append(arms)
            slides.append(ca.dot(_along(touch), v))
        self._slides = ca.vertcat(*slides)
        least = ca.SX(FAR)
        for side in self.sides:
            least = ca.fmin(least, ca.if_else(side.active, side.gap, FAR))
        self.gap = ca.if_else(least < FAR, least, contacts.margin)

    def _velocity(self, body: str, arm: ca.SX) -> ca.SX:
        """Of the point of a body at `arm` from its origin; 0 of the ground."""
        if body == "ground":
            return ca.SX(2, 1)
        frame, rate = self._model.frames[body], self._model.rate
        return rate(frame.origin) + rate(frame.angle) * ca.vertcat(-arm[1], arm[0])

    @property
    def energy(self) -> ca.SX:
        if self._z is None:
            return super().energy
        return super().energy + 0.5 * self._p["k_contact"] * ca.sumsqr(self._z)

    def _pushes(self, laws: ca.SX | None) -> ca.SX:
        each = [None] * len(self.sides) if laws is None else ca.vertsplit(laws)
        return ca.vertcat(*(s.force(law) for s, law in zip(self.sides, each, strict=True)))

    def _breaks(self, pushes: ca.SX) -> ca.SX:
        """Deflections at which the contacts slide."""
        return self._p["mu_contact"] * ca.fmax(pushes, 0) / self._p["k_contact"]

    def efforts(self, laws: ca.SX | None = None) -> ca.SX:
        pushes, rubs = self._pushes(laws), ca.SX(len(self.sides), 1)
        if self._z is not None:
            breaks, tau = self._breaks(pushes), self._p["tau_contact"]
            rubs = -self._p["k_contact"] * friction.friction_effort(
                self._z, self._slides, breaks, tau
            )
        wrenches: dict[str, ca.SX] = {}
        for i, (touch, arms) in enumerate(zip(self._touches, self._arms, strict=True)):
            F = touch.normal * pushes[i] + _along(touch) * rubs[i]
            for body, on in ((touch.body, F), (touch.other, -F)):
                if body != "ground":
                    arm = arms[body]
                    wrench = ca.vertcat(on, arm[0] * on[1] - arm[1] * on[0])
                    wrenches[body] = wrenches.get(body, ca.SX(3, 1)) + wrench
        frames, q = self._model.frames, self._model.q
        poses = [ca.vertcat(frames[b].origin, frames[b].angle) for b in wrenches]
        return ca.jtimes(ca.vertcat(*poses), q, ca.vertcat(*wrenches.values()), True)

    def state_rates(self, laws: ca.SX | None = None) -> ca.SX:
        if self._z is None:
            return ca.SX(0, 1)
        breaks, tau = self._breaks(self._pushes(laws)), self._p["tau_contact"]
        return friction.deflection_rate(self._z, self._slides, breaks, tau)


def _along(touch: Touch) -> ca.SX:
    """The tangent of a contact's plane."""
    return ca.vertcat(-touch.normal[1], touch.normal[0])
