"""Estimates with their spread."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from hapticlink.orchestrator.base.arrays import Matrix, Vector
from hapticlink.orchestrator.results.numbers import short

FROM_ZERO = 1e-3
"""Where the search for a parameter begins that is 0 in the scene (SI units)."""
LOOSE = 0.3
"""The relative spread from which on a log does not determine a parameter."""


@dataclass(frozen=True)
class Estimate:
    """A parameter by its key in a scene, with its standard deviation; `assumed` is its value
    before."""

    key: str
    unit: str
    value: float
    spread: float
    assumed: float

    @property
    def determined(self) -> bool:
        return self.spread < LOOSE * abs(self.value)

    @property
    def text(self) -> str:
        spread = short(self.spread) if np.isfinite(self.spread) else "unknown"
        number = f"{short(self.value)} +- {spread} {self.unit}"
        return f"{self.key} = {number} (assumed {short(self.assumed)})"

    def record(self) -> dict[str, Any]:
        """Its part of fit.json; no deviation where the log tells none."""
        return {
            "value": self.value,
            "standard_deviation": self.spread if np.isfinite(self.spread) else None,
            "unit": self.unit,
            "assumed": self.assumed,
        }


def standard_deviations(
    J: Matrix | csr_array, residuals: Vector, blocks: int, common: int
) -> Vector:
    """Standard deviations of least-squares estimates whose residuals are correlated within, but not
    between blocks of successive rows (Liang, Zeger, Biometrika 73 (1986), 13):

        cov = (J'J)^-1 [sum over blocks of J_b' r_b r_b' J_b] (J'J)^-1

    J (n, p), dense or sparse, and residuals (n,) at the estimate; `common` of the parameters act on
    all blocks. Infinite where J'J is singular.
    """
    J = csr_array(J)
    normal = (J.T @ J).toarray()
    inverse = np.linalg.pinv(normal)
    rows = np.array_split(np.arange(len(residuals)), blocks)
    scores = np.array([J[part].T @ residuals[part] for part in rows])
    covariance = inverse @ (scores.T @ scores) @ inverse * blocks / (blocks - common)
    undetermined = np.diag(inverse @ normal) < 0.5
    return np.where(undetermined, np.inf, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
