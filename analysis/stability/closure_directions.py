"""Directions within the loop closures, in which the state of a mechanism is perturbed.

Where closures are redundant, a pose off them contradicts them, and a step from there has no result.
The states q and qd of such a block are moved along an orthonormal basis of null(W), W = dh/dq, in
place of one by one. Other mechanisms are moved off their closures as well, so that the map has the
modes of their stabilisation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from hapticlink.analysis.stability.state_vector import StateEntry
from hapticlink.components.dynamics.linkage_values import closure_jacobian
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.base.signal_names import SHARED

RANK = 1e-6
"""Singular values of W, relative to the largest, that count as 0."""


@dataclass(frozen=True)
class Closures:
    """The closures of a linkage, if there is one."""

    linkage: Linkage | None

    def directions(
        self, coordinates: Sequence[StateEntry], free: NDArray[np.intp], point: Vector
    ) -> Iterator[Vector]:
        """Orthonormal directions (n,) that span the coordinates `free`, within the closures."""
        bound: set[int] = set()
        for block in SHARED:
            places = {
                name: [
                    i
                    for i in free
                    if (c := coordinates[i]).kind == "fmu"
                    and not c.inert
                    and (c.owner, c.variable.partition("[")[0]) == (block, name)
                ]
                for name in ("q", "qd")
            }
            basis = self._basis(point[places["q"]])
            if basis is None:
                continue
            for indices in places.values():
                bound.update(indices)
                for column in basis.T:
                    direction = np.zeros(len(point))
                    direction[indices] = column
                    yield direction
        for i in free:
            if i not in bound:
                direction = np.zeros(len(point))
                direction[i] = 1.0
                yield direction

    @cached_property
    def _jacobian(self) -> Callable[[Vector], Matrix]:
        assert self.linkage is not None
        return closure_jacobian(self.linkage)

    def _basis(self, q: Vector) -> Matrix | None:
        """A basis of null(W) at q, None where no closure is redundant."""
        if not len(q) or self.linkage is None or not self.linkage.closed:
            return None
        W = self._jacobian(q)
        basis: Matrix = null_space(W, rcond=RANK)
        return basis if len(W) > W.shape[1] - basis.shape[1] else None
