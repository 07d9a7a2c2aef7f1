"""Mobility J D^-1 J' of coordinates or points of a linkage at its start pose, in numbers."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.component import Signals
from hapticlink.components.dynamics.assembly import assemble
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.variables import parameters, start_parameters
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.specs.linkage import Linkage

Matrix = NDArray[np.float64]


def start_mobility(
    linkage: Linkage, coordinates: Callable[[LinkageModel], ca.SX]
) -> tuple[Matrix, Matrix]:
    """The mobilities (k x k) of k `coordinates` of a model, with closed and with open loops."""
    p = Signals("p", [*parameters(linkage), *start_parameters(linkage)])
    q0, _ = assemble(LinkageModel(linkage, p, p["q_start"], p["qd_start"]))
    q, qd = ca.SX.sym("q", q0.numel()), ca.SX.sym("qd", q0.numel())
    model = LinkageModel(linkage, p, q, qd)
    J = ca.jacobian(coordinates(model), q)
    start = ca.Function("start", [p.vector], [q0])
    space = OperationalSpace(model)
    both = [space.mobility(J), space.open_mobility(J)]
    mobilities = ca.Function("mobilities", [q, p.vector], both)
    values = [value for v in p.variables for value in v.starts]
    closed, opened = (np.array(m) for m in mobilities(start(values), values))
    return closed, opened
