"""Start poses of a linkage that one FMU serves: those that differ in its start values alone.

Equations have the start pose as parameter. Of the poses that close, and from which the loops have
the same dependent coordinates (linkage/branch.py), they are the same, unless what
`has_free_start` (blocks/start_settings.py) names follows from the start.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from hapticlink.components.component import Signals
from hapticlink.components.dynamics.assembly import TOLERANCE, assemble
from hapticlink.components.dynamics.variables import parameters, start_parameters
from hapticlink.components.linkage.branch import choose_dependent
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Linkage, coordinates

Choice = tuple[tuple[int, ...], tuple[int, ...]]
SURE = 0.1
"""Share of the tolerance of gaps up to which a pose closes whatever the rounding."""


class StartPoses:
    """The start poses of a linkage whatever its `start`. Raises ValueError as `LinkageModel`."""

    def __init__(self, linkage: Linkage) -> None:
        p = Signals("p", [*parameters(linkage), *start_parameters(linkage)])
        q, _ = assemble(LinkageModel(linkage, p, p["q_start"], p["qd_start"]))
        self._model = model = LinkageModel.symbolic(linkage, p)
        gaps = ca.vertcat(ca.SX(0, 1), *(ca.norm_2(c.h) for c in model.closures))
        self._linkage, self._fixed = linkage, Signals("p", parameters(linkage)).starts
        self._gaps = ca.Function("gaps", [p.vector], ca.substitute([gaps], [model.q], [q]))
        self._W = ca.Function("W", [model.q, p.vector], [model.W])

    def choose(self, start: Mapping[str, Any]) -> Choice | None:
        """Rows and columns of the dependent coordinates at a start pose of a linkage at rest; None
        where a loop does not close."""
        q = coordinates(self._linkage, start)
        p = [*self._fixed, *q, *np.zeros(len(q))]
        if not (np.array(self._gaps(p)) < SURE * TOLERANCE).all():
            return None
        rows, columns = choose_dependent(self._model, np.array(self._W(q, p), dtype=float))
        return tuple(rows), tuple(columns)
