"""Massless bodies: detects poses at which one can move without moving any mass, where the equations
of motion are singular; at the start such a pose is an error, during a run it ends the run.

With M^ the masses and inertias of the scene, replaced by 0 or equal sizes, J of all bodies and N a
basis of null(W), N' J' M^ J N is singular exactly where D restricted to the closed loops is,
independently of how light the other bodies are. Near such a pose rates grow without bound (a
massless crank whose rocker has reached its end), and no step can pass it: a massless coordinate
that turns by more than 1 rad in a step, or slides by more than the mean link length, ends the run.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from hapticlink.components.component import Component
from hapticlink.components.dynamics.light_bodies import groups, smallest_inertia
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import mean_link_length

SINGULAR = 1e-10  # relative to the same matrix with mass and inertia everywhere


class MasslessError(ValueError):
    """A body without mass or inertia that can move without moving any mass."""


def require_inertia(component: Component, model: LinkageModel) -> None:
    """Raises MasslessError for a massless body that is free to move at the default start pose."""
    bodies, n = model.linkage.body, model.q.numel()
    if all(b.mass and b.inertia for b in bodies):
        return
    from scipy.linalg import eigh, null_space  # slow to load

    start = component.initialize(component.start_inputs, component.start_parameters)[:n]
    poses = ca.vertcat(
        *(ca.vertcat(model.centers[b.name], model.frames[b.name].angle) for b in bodies)
    )
    jacobians = ca.Function("J", [model.q, model.p.vector], [ca.jacobian(poses, model.q), model.W])
    J, W = (np.array(v) for v in jacobians(start, component.start_parameters))
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


def massless_coordinates(model: LinkageModel) -> dict[int, tuple[str, float]]:
    """The massless coordinates of loops: by index in q, the body and the largest change in one step
    (rad or m)."""
    bodies = {b.name: b for b in model.linkage.body}
    most = {"rad": 1.0, "m": mean_link_length(model.linkage)}
    return {
        model.coordinate(joint.name) + i: (joint.child, most[unit])
        for group in groups(model.linkage)
        for joint in group
        for i, (unit, own) in enumerate(
            zip(joint.kind.units, smallest_inertia(joint, bodies[joint.child]), strict=True)
        )
        if own == 0
    }


def refuse_jumps(model: LinkageModel, q: ca.SX, qd: ca.SX, h: ca.SX) -> ca.SX:
    """q, made NaN or infinite where a massless coordinate moves too far within h."""
    q = ca.SX(q)
    for i, (_, most) in massless_coordinates(model).items():
        q[i] = q[i] / (ca.fabs(h * qd[i]) < most)
    return q


def notes(model: LinkageModel) -> dict[str, str]:
    """By the name of a state, the cause to report if it is not finite."""
    return {
        f"q[{i + 1}]": f"massless body `{body}`, which its loops no longer carry"
        for i, (body, _) in massless_coordinates(model).items()
    }
