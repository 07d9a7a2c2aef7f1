"""Bounds on the magnitude of outputs: a run that exceeds one has diverged, though its numbers are
still finite."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.variables import Scalar

GROWTH = 1e12
"""Times the larger of its start and its nominal, for an output that states no bound."""


class Bounds:
    """The bounds of `outputs`, a view that is read at each check. Before `start` an output only has
    to be finite."""

    def __init__(self, description: Description, outputs: NDArray[np.float64]) -> None:
        self._scalars, self._outputs = description.outputs, outputs
        self.inverse, self._shares = np.zeros(len(outputs)), np.zeros(len(outputs))

    def start(self) -> None:
        """Sets the bounds from the start values. Integers have the bounds of their types; a Real
        without a unit is no known physical quantity and has none."""
        nominal = np.array([s.nominal for s in self._scalars])
        bounds = GROWTH * np.maximum(np.abs(self._outputs), nominal)
        for i, scalar in enumerate(self._scalars):
            if scalar.bound:
                bounds[i] = scalar.bound
            elif scalar.unit is None or scalar.type not in ("Real", "Float64", "Float32"):
                bounds[i] = np.inf
        self.inverse[:] = 1.0 / bounds

    def hold(self) -> bool:
        """Whether all outputs are certainly finite and within their bounds: one pass over the
        vector, since this is asked at every read."""
        np.multiply(self._outputs, self.inverse, out=self._shares)
        return bool(self._shares.dot(self._shares) <= 1.0)  # not where one is NaN or infinite

    def first_beyond(self) -> tuple[Scalar, float, float] | None:
        """(output, value, bound) of the first output beyond its bound, None if there is none."""
        for scalar, value, inverse in zip(
            self._scalars, self._outputs.tolist(), self.inverse.tolist(), strict=True
        ):
            if abs(value) * inverse > 1.0:
                return scalar, value, 1.0 / inverse
        return None
