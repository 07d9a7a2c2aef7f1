"""Bodies that are much lighter than the others of their loops, down to zero mass.

A light body whose motion is determined by its loops follows the others, and its mass hardly
matters; yet it dominates S = W D^-1 W'. In the metric in which closures are solved
(closed_loop_solver.py) a coordinate whose own body has almost no inertia is therefore given an
additional one,

    k = M  (sliding)  or  M a^2  (turning),     M = mean m + mean I / a^2

means over the bodies that its loops move, with a^2 the mean square of the rotational columns of W,
the lever arms of the loops. Groups of bodies that share no loop do not affect each other. Which
coordinates are light follows from the scene's masses; k follows from the FMU's parameters.
"""

from __future__ import annotations

import math

import casadi as ca

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
