"""Bodies that are much lighter than the others of their loops, down to zero mass.

A light body whose motion is determined by its loops follows the others, and its mass hardly
matters; yet it dominates S = W D^-1 W'. In the metric in which closures are solved
(closed_loop_solver.py) a coordinate whose own body has almost no inertia is therefore given an
additional one,

    k = M  (sliding)  or  M a^2  (turning),     M = mean m + mean I / a^2

means over the bodies that its loops move, with a^2 the mean square of the rotational columns of W,
the lever arms of the loops. Groups of bodies that share no loop do not affect each other. Which
coordinates are light follows from the scene's masses; k follows from the FMU's parameters.

At some poses a massless body can move without moving any mass, and the equations of motion are
singular; at the start such a pose is an error, during a run it ends the run. With M^ the masses and
inertias of the scene, replaced by 0 or equal sizes, J of all bodies and N a basis of null(W),

    N' J' M^ J N

is singular exactly where D restricted to the closed loops is, however light the other bodies are.
Near such a pose rates grow without bound (a massless crank whose rocker has reached its end), and
no step can pass it: a massless coordinate that turns by more than 1 rad in a step, or slides by
more than the mean link length, ends the run.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from hapticlink.components.component import Component
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.linkage.parameters import mean_link_length
from hapticlink.components.specs.linkage import Body, Joint, Linkage

LIGHT = 1e-2  # relative to the mean


def groups(linkage: Linkage) -> list[list[Joint]]:
    """Groups of joints whose loops are connected by shared joints; each joint of a loop is in one
    group."""
    chains: list[set[str]] = []
    cycles = [_way(linkage, a) ^ _way(linkage, b) for a, b in (o.bodies for o in linkage.loop)]
    for cycle in (*cycles, *(set(gear.joints) for gear in linkage.gear)):
        shared = [group for group in chains if group & cycle]
        chains = [group for group in chains if not group & cycle] + [cycle.union(*shared)]
    return [[j for j in linkage.joint if j.name in group] for group in chains]


def _way(linkage: Linkage, body: str) -> set[str]:
    """Names of the joints from the ground to a body."""
    joints = {j.child: j for j in linkage.joint}
    way: set[str] = set()
    while body != "ground":
        way.add(joints[body].name)
        body = joints[body].parent
    return way


def smallest_inertia(joint: Joint, body: Body) -> list[float]:
    """The smallest inertia of a body at each coordinate of its joint (kg or kg.m2)."""
    arm = math.dist(body.center or (0.0, 0.0), joint.at_child or (0.0, 0.0))
    turning = body.inertia + body.mass * arm**2
    sliding = body.mass
    if joint.kind.turns:  # the body may turn out of the way of its mass
        sliding = body.mass * body.inertia / turning if turning else 0.0
    if joint.kind.slides:  # or turn about its centre of mass
        turning = body.inertia
    return [turning if freedom.turns else sliding for freedom in joint.kind.freedoms]


def added_inertia(model: LinkageModel, W: ca.SX) -> ca.SX:
    """k (n x 1; kg or kg.m2), zero except for light coordinates."""
    linkage, p, k = model.linkage, model.p, ca.SX(W.shape[1], 1)
    bodies, length = {b.name: b for b in linkage.body}, mean_link_length(linkage)
    for group in groups(linkage):
        names = {j.name for j in group}
        moved = [b for b in linkage.body if names & _way(linkage, b.name)]
        mean = sum(b.mass + b.inertia / length**2 for b in moved) / len(moved)
        turning, light = [], []
        for joint in group:
            for i, own in enumerate(smallest_inertia(joint, bodies[joint.child])):
                index = model.coordinate(joint.name) + i
                turns = joint.kind.freedoms[i].turns
                turning += [index] if turns else []
                light += [index] if own < LIGHT * mean * (length**2 if turns else 1) else []
        arm = ca.sumsqr(W[:, turning]) / len(turning) if turning else ca.SX(1)
        M = sum(p[f"{b.name}.mass"] + p[f"{b.name}.inertia"] / arm for b in moved) / len(moved)
        for index in light:
            k[index] = M * arm if index in turning else M
    return k


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
