"""The sides on which places are kept that would pass through a shape in one step (swept.py), a
state of the block that detects contacts: a normal for each place, 0 where it is not kept."""

from __future__ import annotations

import casadi as ca

from hapticlink.components.component import Signals, Variable
from hapticlink.components.contact.broad_phase import near
from hapticlink.components.contact.detection import MovingPoint, swept_places
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.linkage import Linkage

NAME = "kept_sides"


def states(linkage: Linkage, contacts: Contacts) -> list[Variable]:
    """The state, without entries where nothing can be passed through."""
    k = sum(pair.places for pair in near(linkage, contacts) if pair.kind != "enclosure")
    text = "normals on whose sides contacts are kept, in the frame of what is touched"
    return [Variable(NAME, (k, 2), description=text)] if k else []


class KeptSides:
    """The places of a model, whose q and qd are symbols, with the sides on which they are kept
    (k x 2)."""

    def __init__(self, model: LinkageModel, contacts: Contacts, kept: ca.SX) -> None:
        self._model, self._kept = model, kept
        self._places: list[MovingPoint] = swept_places(model, contacts, model.p)

    def in_step(self, h: ca.SX) -> ca.SX:
        """The sides for a step of h (s) at the velocities of its begin."""
        return self._entered([self._model.rate(place.x) * h for place in self._places])

    def between(self, q: ca.SX, p: Signals) -> ca.SX:
        """The sides at coordinates q to which the straight path leads from the model's. Only places
        inside are kept: held geometry did not stop others."""
        xs = ca.vertcat(*(place.x.T for place in self._places))
        x1 = ca.Function("x", [self._model.q, p.vector], [xs])(q, p.vector)
        ways = [row.T - place.x for row, place in zip(ca.vertsplit(x1), self._places, strict=True)]
        return self._after(self._entered(ways), q, p, inside=True)

    def after_step(self, entered: ca.SX, q: ca.SX, p: Signals) -> ca.SX:
        """The sides that stay kept at coordinates q of those during the step."""
        return self._after(entered, q, p, inside=False)

    def _entered(self, ways: list[ca.SX]) -> ca.SX:
        each = zip(self._places, ca.vertsplit(self._kept), ways, strict=True)
        return ca.vertcat(*(place.entered(kept.T, way).T for place, kept, way in each))

    def _after(self, entered: ca.SX, q: ca.SX, p: Signals, *, inside: bool) -> ca.SX:
        sides = ca.SX.sym("sides", *entered.shape)
        rows = []
        for place, side in zip(self._places, ca.vertsplit(sides), strict=True):
            keeps = place.keeps(side.T)
            keeps = ca.logic_and(keeps, place.is_inside) if inside else keeps
            rows.append(ca.if_else(keeps, side, 0))
        after = ca.Function(
            "kept", [self._model.q, sides, p.vector], [ca.vertcat(*rows)], {"cse": True}
        )
        return after(q, entered, p.vector)
