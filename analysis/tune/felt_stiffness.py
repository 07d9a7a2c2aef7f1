"""What a hand feels: the dynamic stiffness 1/|n' X n| (N/m) of the handle along a wrench n with a
unit force, X its compliance at a frequency of pressing (`Response.compliance`).

Of a joint constraint n is a wrench that no motion of the mechanism answers, in null(S Lambda^-1 S),
the one of them with the largest force; of a contact it is the contact's.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.optimize import brentq

from hapticlink.analysis.search.search import DOUBLINGS, FINE
from hapticlink.analysis.search.settings import Scales
from hapticlink.analysis.stability.resting_scene import RestingScene
from hapticlink.components.dynamics.rendered_directions import WHOLE, RenderedDirections
from hapticlink.components.linkage.parameters import mean_link_length
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.arrays import Complex, Matrix, Vector
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.orchestrator.base.signal_names import (
    MOBILITIES,
)

HERTZ = 2.0
"""Frequency of pressing: the slower, the stiffer a constraint feels, whatever its gains."""
RIGID = 1e7
"""Felt stiffness (N/m) above which nothing gives way."""
CONSTRAINED = 1e-6
"""Of the largest scaled mobility, up to which a direction does not move."""


def mobility(place: RestingScene) -> Matrix:
    """Lambda^-1 (m, m) at an equilibrium. Raises InputFault where no FMU puts it out."""
    for port in MOBILITIES:
        if len(values := place.signal(port)) == place.space.size**2:
            return values.reshape(place.space.mobility.shape)
    raise InputFault(f"no FMU puts out the mobility of the mechanism ({' or '.join(MOBILITIES)})")


class Feel:
    """What is felt in a pose along unit wrenches, by name: "constraint", "contact"."""

    def __init__(self, place: RestingScene, along: Mapping[str, Vector]) -> None:
        self._place, self.along, self.gains = place, along, place.gains

    @classmethod
    def of(
        cls, place: RestingScene, linkage: Linkage, rendered: RenderedDirections = WHOLE
    ) -> Feel:
        """In the directions that a device renders. Raises InputFault where no direction is
        constrained and nothing touches."""
        found = {}
        S: Matrix = np.diag(np.array(linkage.space.scaling(mean_link_length(linkage)), float))
        felt = np.array(rendered.rows)
        reduced = felt @ S @ rendered.felt_mobility(mobility(place)) @ S @ felt.T
        values, vectors = np.linalg.eigh(reduced)
        vectors = felt.T @ vectors
        null = [S @ vectors[:, i] for i in np.flatnonzero(values < CONSTRAINED * values[-1])]
        if null:
            n = max(null, key=lambda wrench: float(linkage.space.distance(wrench)))
            found["constraint"] = n / linkage.space.distance(n)
        F = place.contact if rendered.whole else felt.T @ (felt @ place.contact)
        if size := float(linkage.space.distance(F)):
            found["contact"] = F / size
        if not found:
            raise InputFault(
                "no direction of the handle is constrained, and nothing touches: no stiffness to "
                "tune; take a linkage with loops or fewer joints, or [contacts]"
            )
        return cls(place, found)

    def compliance(self, scales: Scales) -> Complex:
        """That of the handle, (3, 3), in a firm grip."""
        return self._place.compliance(scales, HERTZ)

    def felt(self, X: Complex) -> dict[str, float]:
        """The felt stiffness (N/m) along each wrench; infinite where nothing gives way."""
        gives = {name: float(abs(n @ X @ n)) for name, n in self.along.items()}
        return {name: 1.0 / x if x * RIGID > 1.0 else np.inf for name, x in gives.items()}

    def alike(self, scales: Scales) -> Scales:
        """`scales` with the topology's one with which the constraint feels like the contact.
        Raises InputFault where there is none."""

        def apart(logarithm: float) -> float:
            felt = self.felt(self.compliance({**scales, "topology": float(np.exp(logarithm))}))
            return float(np.log(felt["constraint"] / felt["contact"]))

        end = float(np.log(scales["topology"]))
        way = -np.sign(apart(end)) * np.log(2.0)
        for _ in range(DOUBLINGS):
            start, end = end, end + way
            if apart(end) * way >= 0.0:
                root = brentq(apart, start, end, xtol=FINE)
                return {**scales, "topology": float(np.exp(root))}
        raise InputFault("no stiffness of the topology controller feels like the contact")
