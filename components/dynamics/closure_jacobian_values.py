"""The Jacobian of the loop closures of a linkage, in numbers."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.component import Signals
from hapticlink.components.dynamics.variables import parameters
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Linkage

Matrix = NDArray[np.float64]


def closure_jacobian(linkage: Linkage) -> Callable[[NDArray[np.float64]], Matrix]:
    """W(q) = dh/dq of (2.14), (m, n), with the linkage's own parameters. Raises ValueError as
    `LinkageModel` does."""
    p = Signals("p", parameters(linkage))
    model = LinkageModel.symbolic(linkage, p)
    W = ca.Function("W", [model.q, p.vector], [model.W])
    return lambda q: np.array(W(q, p.starts))
