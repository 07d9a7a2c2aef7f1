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


def pose_function(linkage: Linkage) -> tuple[list[str], ca.Function]:
    """The names of the bodies, "ground" among them, and their poses as a function of the joint
    coordinates, (n,): (x m, y m, theta rad), (3, k), in space the origin (m) and the columns of the
    rotation matrix, (12, k). Raises ValueError as `LinkageModel` does."""
    p = Signals("p", body_parameters(linkage))
    model = LinkageModel.symbolic(linkage, p)
    turned = (f.angle if model.d == 2 else ca.vec(f.rotation) for f in model.frames.values())
    ends = zip(model.frames.values(), turned, strict=True)
    stacked = ca.densify(ca.horzcat(*(ca.vertcat(f.origin, turn) for f, turn in ends)))
    function = ca.Function("poses", [model.q, p.vector], [stacked])
    return [*model.frames], ca.Function("poses", [model.q], [function(model.q, p.starts)])


def poses(linkage: Linkage, q: Sequence[Sequence[float]]) -> dict[str, NDArray[np.float64]]:
    """The pose of each body's frame in the world, as `pose_function` has it, (k, 3) or (k, 12), at
    joint coordinates q (k, n); "ground" is among the bodies. Raises ValueError as `LinkageModel`
    does."""
    names, function = pose_function(linkage)
    results = [np.array(function(row)) for row in np.atleast_2d(np.asarray(q, float))]
    return {name: np.array([r[:, i] for r in results]) for i, name in enumerate(names)}
