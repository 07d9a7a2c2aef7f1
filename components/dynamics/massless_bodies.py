"""Massless bodies: refused where they could move with nothing that has mass.

With M^ the masses and inertias of the scene, each of one size or zero, J of all bodies and N a
basis of null(W), N' J' M^ J N is singular where D is on the closed loops, and nowhere else: how
light the others are does not matter.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.linalg import eigh, null_space

from hapticlink.components.component import Component
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import mean_link_length

SINGULAR = 1e-10  # of the same with mass and inertia everywhere


class MasslessError(ValueError):
    """A body without mass or inertia that its loops leave free to move."""


def require_inertia(component: Component, model: LinkageModel) -> None:
    """Raises MasslessError naming a massless body that is free at the default start pose."""
    bodies, n = model.linkage.body, model.q.numel()
    if all(b.mass and b.inertia for b in bodies):
        return
    start = component.initialize(component.start_inputs, component.start_parameters)[:n]
    poses = ca.vertcat(
        *(ca.vertcat(model.centers[b.name], model.frames[b.name].angle) for b in bodies)
    )
    at = ca.Function("J", [model.q, model.p.vector], [ca.jacobian(poses, model.q), model.W])
    J, W = (np.array(v) for v in at(start, component.start_parameters))
    moves = J @ (null_space(W, 1e-9) if len(W) else np.eye(n))
    size = np.tile([1.0, 1.0, mean_link_length(model.linkage) ** 2], len(bodies))
    has = np.ravel([(b.mass > 0, b.mass > 0, b.inertia > 0) for b in bodies])
    values, motions = eigh((moves.T * (size * has)) @ moves, (moves.T * size) @ moves)
    if values.size and values[0] < SINGULAR:
        motion = size * (moves @ motions[:, 0]) ** 2
        shares = (motion * ~has).reshape(-1, 3).sum(1)
        body = bodies[int(shares.argmax())]
        what = " and ".join(w for w in ("mass", "inertia") if not getattr(body, w))
        raise MasslessError(
            f"body `{body.name}` has {what} 0, and from the start pose it can move without moving "
            f"anything that has: give it {what}, or loops that leave it no freedom of its own"
        )
