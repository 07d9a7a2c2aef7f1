"""Terms of a linkage in numbers: the Jacobian of its closures, and mobilities at its start pose."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.component import Signals
from hapticlink.components.dynamics.assembly import start_coordinates
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.variables import parameters, start_parameters
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


def start_mobility(
    linkage: Linkage, coordinates: Callable[[LinkageModel], ca.SX]
) -> tuple[Matrix, Matrix]:
    """The mobilities (k x k) of k `coordinates` of a model, with closed and with open loops."""
    p = Signals("p", [*parameters(linkage), *start_parameters(linkage)])
    model = LinkageModel.symbolic(linkage, p)
    J, space = ca.jacobian(coordinates(model), model.q), OperationalSpace(model)
    both = [space.mobility(J), space.open_mobility(J)]
    mobilities = ca.Function("mobilities", [model.q, p.vector], both)
    closed, opened = (np.array(m) for m in mobilities(start_coordinates(linkage), p.starts))
    return closed, opened
