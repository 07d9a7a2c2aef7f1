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

import casadi as ca
import numpy as np

from hapticlink.components.component import Component
from hapticlink.components.linkage.model import LinkageModel, turn_axis
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
    lever = np.subtract(*((*(at or (0.0, 0.0)), 0.0)[:3] for at in (body.center, joint.at_child)))
    least, arm = body.moments[0], 0.0  # about the line through its centre of mass
    turns = [freedom for freedom in joint.kind.freedoms if freedom.turns]
    if len(turns) == 1:
        axis = np.array(turn_axis(joint, turns[0]))
        least = float(axis @ body.inertia_tensor @ axis)
        arm = float(np.linalg.norm(np.cross(axis, lever)))
    turning, sliding = least + body.mass * arm**2, body.mass
    if turns:  # the body may turn out of the way of its mass
        whole = least + body.mass * float(lever @ lever)
        sliding = body.mass * least / whole if whole else 0.0
    if joint.kind.slides:  # or turn about its centre of mass
        turning = least
    of_ball = turning / 4  # half a turn from 0 its coordinates are twice the angle
    return [
        (of_ball if f.about == "ball" else turning) if f.turns else sliding
        for f in joint.kind.freedoms
    ]


def added_inertia(model: LinkageModel, W: ca.SX) -> ca.SX:
    """k (n x 1; kg or kg.m2), zero except for light coordinates."""
    linkage, p, k = model.linkage, model.p, ca.SX(W.shape[1], 1)
    bodies, length = {b.name: b for b in linkage.body}, mean_link_length(linkage)
    for group in groups(linkage):
        names = {j.name for j in group}
        moved = [b for b in linkage.body if names & _way(linkage, b.name)]
        mean = sum(b.mass + b.moments[0] / length**2 for b in moved) / len(moved)
        turning, light = [], []
        for joint in group:
            for i, own in enumerate(smallest_inertia(joint, bodies[joint.child])):
                index = model.coordinate(joint.name) + i
                turns = joint.kind.freedoms[i].turns
                turning += [index] if turns else []
                light += [index] if own < LIGHT * mean * (length**2 if turns else 1) else []
        arm = ca.sumsqr(W[:, turning]) / len(turning) if turning else ca.SX(1)
        masses = (p[f"{b.name}.mass"] + _mean(p[f"{b.name}.inertia"]) / arm for b in moved)
        M = sum(masses) / len(moved)
        for index in light:
            k[index] = M * arm if index in turning else M
    return k


def _mean(inertia: ca.SX) -> ca.SX:
    """The mean of a body's moments of inertia (kg.m2)."""
    return inertia if inertia.numel() == 1 else ca.sum1(inertia[:3]) / 3


SINGULAR = 1e-10  # relative to the same matrix with mass and inertia everywhere


class MasslessError(ValueError):
    """A body without mass or inertia that can move without moving any mass."""


def require_inertia(component: Component, model: LinkageModel) -> None:
    """Raises MasslessError for a massless body that is free to move at the default start pose."""
    bodies, n = model.linkage.body, model.q.numel()
    if all(b.mass and b.moments[0] for b in bodies):
        return
    from scipy.linalg import eigh, null_space  # slow to load

    start = component.initialize(component.start_inputs, component.start_parameters)[:n]
    weighted = model.bodies.values()
    poses, weights = (ca.vertcat(*parts) for parts in zip(*weighted, strict=True))
    functions = [ca.jacobian(poses, model.q), model.W, weights]
    jacobians = ca.Function("J", [model.q, model.p.vector], functions)
    J, W, M = (np.array(v) for v in jacobians(start, component.start_parameters))
    moves = J @ (null_space(W, 1e-9) if len(W) else np.eye(n))
    d, length = model.d, mean_link_length(model.linkage)
    lengths = [[1.0] * d + [length**2] * (pose.numel() - d) for pose, _ in weighted]
    size, has = np.concatenate(lengths), M.ravel() != 0
    values, motions = eigh((moves.T * (size * has)) @ moves, (moves.T * size) @ moves)
    if values.size and values[0] < SINGULAR:
        motion = size * (moves @ motions[:, 0]) ** 2
        ends = np.cumsum([len(of) for of in lengths])[:-1]
        shares = [float(part.sum()) for part in np.split(motion * ~has, ends)]
        body = bodies[int(np.argmax(shares))]
        lacks = (("mass", not body.mass), ("inertia", not body.moments[0]))
        what = " and ".join(name for name, is_lacking in lacks if is_lacking)
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
