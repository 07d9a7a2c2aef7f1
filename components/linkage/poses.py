"""Where the bodies of a linkage are, in numbers."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hapticlink.components.component import Signals
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import body_parameters
from hapticlink.components.specs.linkage import Linkage


def poses(linkage: Linkage, q: Sequence[Sequence[float]]) -> dict[str, NDArray[np.float64]]:
    """(x m, y m, theta rad) of each body's frame in the world, (k, 3), at joint coordinates q
    (k, n); "ground" is among the bodies. Raises ValueError as `LinkageModel` does."""
    parameters = body_parameters(linkage)
    p = Signals("p", parameters)
    rows = np.atleast_2d(np.asarray(q, float))
    model = LinkageModel(linkage, p, ca.SX.sym("q", rows.shape[1]), ca.SX(rows.shape[1], 1))
    found = {name: ca.vertcat(f.origin, f.angle) for name, f in model.frames.items()}
    at = ca.Function("poses", [model.q, p.vector], list(found.values()))
    values = [value for variable in parameters for value in variable.starts]
    results = [[np.array(r).ravel() for r in at(row, values)] for row in rows]
    return {name: np.array([r[i] for r in results]) for i, name in enumerate(found)}
