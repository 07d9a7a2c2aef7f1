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
from hapticlink.components.specs.quantities import Place


def pose_function(linkage: Linkage) -> tuple[list[str], ca.Function]:
    """The names of the bodies, "ground" among them, and their poses (x m, y m, theta rad), (3, k),
    as a function of the joint coordinates, (n,). Raises ValueError as `LinkageModel` does, and for
    a linkage in space."""
    if linkage.dimension > 2:
        raise ValueError("poses (x, y, theta) are those of a linkage in the plane")
    p = Signals("p", body_parameters(linkage))
    model = LinkageModel.symbolic(linkage, p)
    stacked = ca.horzcat(*(ca.vertcat(f.origin, f.angle) for f in model.frames.values()))
    function = ca.Function("poses", [model.q, p.vector], [stacked])
    return [*model.frames], ca.Function("poses", [model.q], [function(model.q, p.starts)])


def place_function(linkage: Linkage, places: Sequence[tuple[str, Place | None]]) -> ca.Function:
    """The places in the world (m), (d, k), of k points of bodies, each given in the frame of its
    body, as a function of the joint coordinates, (n,). Raises ValueError as `LinkageModel` does."""
    p = Signals("p", body_parameters(linkage))
    model = LinkageModel.symbolic(linkage, p)
    points = [
        model.frames[body].point(None if at is None else model.lifted(ca.SX(ca.DM(at))))
        for body, at in places
    ]
    function = ca.Function("places", [model.q, p.vector], [ca.densify(ca.horzcat(*points))])
    return ca.Function("places", [model.q], [function(model.q, p.starts)])


def poses(linkage: Linkage, q: Sequence[Sequence[float]]) -> dict[str, NDArray[np.float64]]:
    """(x m, y m, theta rad) of each body's frame in the world, (k, 3), at joint coordinates q
    (k, n); "ground" is among the bodies. Raises ValueError as `LinkageModel` does."""
    names, function = pose_function(linkage)
    results = [np.array(function(row)) for row in np.atleast_2d(np.asarray(q, float))]
    return {name: np.array([r[:, i] for r in results]) for i, name in enumerate(names)}
