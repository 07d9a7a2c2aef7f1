"""How large an output may become: a run that goes beyond has left physics, though its numbers are
finite."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hapticlink.orchestrator.fmi.description import Description
from hapticlink.orchestrator.fmi.variables import Scalar

GROWTH = 1e12
"""Times the larger of its start and its nominal, for an output that states no bound."""


class Bounds:
    """The bounds of `outputs`, which are read where they stand. Before `start` nothing is known of
    them, but that they are finite."""

    def __init__(self, description: Description, outputs: NDArray[np.float64]) -> None:
        self._scalars, self._outputs = description.outputs, outputs
        self._inverse, self._shares = np.zeros(len(outputs)), np.zeros(len(outputs))

    def start(self) -> None:
        """The outputs stand at their start. Whole numbers have the bounds of their types; a Real
        without a unit is no physical quantity that is known, and may be of any size."""
        nominal = np.array([s.nominal for s in self._scalars])
        bounds = GROWTH * np.maximum(np.abs(self._outputs), nominal)
        for i, scalar in enumerate(self._scalars):
            if scalar.bound:
                bounds[i] = scalar.bound
            elif scalar.unit is None or scalar.type not in ("Real", "Float64", "Float32"):
                bounds[i] = np.inf
        self._inverse[:] = 1.0 / bounds

    def kept(self) -> bool:
        """Whether all outputs are surely finite and within their bounds: one pass, as it is asked
        at every read."""
        np.multiply(self._outputs, self._inverse, out=self._shares)
        return bool(self._shares.dot(self._shares) <= 1.0)  # not where one is NaN or infinite

    def first_beyond(self) -> tuple[Scalar, float, float] | None:
        """(output, value, bound) of the first that is beyond."""
        for scalar, value, inverse in zip(
            self._scalars, self._outputs.tolist(), self._inverse.tolist(), strict=True
        ):
            if abs(value) * inverse > 1.0:
                return scalar, value, 1.0 / inverse
        return None
