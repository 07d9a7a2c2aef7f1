"""Input derivatives: held inputs as polynomials in time, for FMUs that can interpolate inputs.

Within a step of size H a hold of degree k is a polynomial, u(t + r H) = sum_j c_j r^j, determined
by its values at k + 1 instants. The FMU gets u(t) by fmi2SetReal and j! c_j / H^j for j = 1..k by
fmi2SetRealInputDerivatives, both at the beginning of the step (FMI 2.0.5 section 4.2.1). Energies
use the mean over the step, sum_j c_j / (j + 1). FMI 3.0 has no such call.
"""

from __future__ import annotations

from functools import cache
from math import factorial

import numpy as np

from hapticlink.orchestrator.base.arrays import Vector
from hapticlink.orchestrator.fmi.capabilities import takes_input_derivatives
from hapticlink.orchestrator.fmi.kind_check import MATRICES
from hapticlink.orchestrator.holds import HOLDS
from hapticlink.orchestrator.system.system import Connection, System


def degree(system: System, connection: Connection) -> int:
    """Degree of a held input as a polynomial within a step of its plant; 0 where it is constant,
    and for projectors and semidefinite matrices, whose held value is no polynomial."""
    if not connection.hold or connection.initial or system.fmu[connection.target].sampled:
        return 0
    if connection.kind in MATRICES:
        return 0
    return HOLDS[connection.hold].degree


def order(system: System, connection: Connection) -> int:
    """The highest derivative that the target of a connection gets with its inputs; 0 where it takes
    none, and for inputs that are not continuous Reals."""
    continuous = all(s.type == "Real" and s.variability == "continuous" for s in connection.inputs)
    taken = continuous and takes_input_derivatives(system.fmu[connection.target].description)
    return degree(system, connection) if taken else 0


@cache
def coefficients(order: int) -> Vector:
    """The matrix (order + 1, order + 1) that maps values at r = 0, 1/order, ..., 1 to c_0, c_1, ...
    (inverse of a Vandermonde matrix)."""
    instants = np.linspace(0.0, 1.0, order + 1)
    return np.linalg.inv(np.vander(instants, increasing=True)).astype(np.float64)


def split(values: Vector, width: float) -> tuple[Vector, Vector]:
    """Derivatives (order, n), j! c_j / H^j with H = `width` (s), and mean (n,) of a polynomial,
    from its values (order + 1, n) at equidistant instants from the beginning to the end of a
    step."""
    scaled = coefficients(len(values) - 1) @ values
    orders = range(1, len(values))
    scales = [factorial(j) / width**j for j in orders]
    shares = [1 / (1 + j) for j in (0, *orders)]
    return scaled[1:] * np.array(scales)[:, None], np.array(shares) @ scaled
