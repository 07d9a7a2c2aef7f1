"""Further operational points: each has an input for a hand's wrench, and its pose, velocity and
mobility as outputs.

    x = x_k(q),   v = J_k qd,   Lambda_k^-1 = J_k D^-1 (J_k' - W' (W D^-1 W')^-1 W D^-1 J_k')

Their wrenches act on the linkage in addition to that at the operational point: Q += J_k' F_k.

A point that a device holds, that of another user, has all that the operational point has: F_drift
(-), a_bias, F_env and P_c. What a user's F_env adds up is what all others do to the linkage, the
other users among them, by the mobility between their points:

    Lambda_k^-1 F_env_k = sum_j Lambda_kj^-1 (F_hand_j - F_drift_j) + contacts
    Lambda_kj^-1 = J_k D^-1 (J_j' - W' (W D^-1 W')^-1 W D^-1 J_j')
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import casadi as ca

from hapticlink.components.component import Block, Signals, Variable
from hapticlink.components.dynamics.constrained_directions import (
    ConstrainedDirections,
    Points,
    constrained_directions,
)
from hapticlink.components.dynamics.equivalent_wrench import equivalent_wrench, wrench_output
from hapticlink.components.dynamics.operational_space import OperationalSpace
from hapticlink.components.dynamics.rendered_directions import rendered_directions
from hapticlink.components.dynamics.variables import mobility_output
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.ports import Power
from hapticlink.components.specs.device import Handle
from hapticlink.components.specs.linkage import Linkage

Users = tuple[str, ...]
"""The names of the points that a device holds."""
Handles = Mapping[str, Handle]
"""The handles of devices by the points that they hold; the operational point's name is empty."""


def inputs(linkage: Linkage, users: Users) -> Iterator[Variable]:
    for name in (point.name for point in linkage.point):
        pose = f"{name}.x"
        text = f"wrench at {name}"
        yield Variable(f"{name}.F_hand", *linkage.space.wrench, description=text, power=Power(pose))
        if name in users:
            text = f"virtual coupling at {name}, acts with - on the mechanism"
            drift = Power(pose, sign=-1.0)
            yield Variable(f"{name}.F_drift", *linkage.space.wrench, description=text, power=drift)


def outputs(linkage: Linkage, users: Users, *, mobility: bool) -> Iterator[Variable]:
    for name in (point.name for point in linkage.point):
        x = f"{name}.x"
        yield Variable(x, *linkage.space.pose, description=f"pose of {name}")
        text = f"velocity of {name}"
        yield Variable(f"{name}.v", *linkage.space.twist, description=text, derivative_of=x)
        if mobility:
            yield mobility_output(linkage.space, f"{name}.", name)
        if name in users:
            text = f"acceleration of {name} at zero wrench"
            yield Variable(f"{name}.a_bias", *linkage.space.acceleration, description=text)
            yield wrench_output(linkage.space, f"{name}.", name)


def counts(users: Users) -> list[str]:
    """The states that hold the number of constrained directions, of the operational point first."""
    return ["n_constrained", *(f"{name}.n_constrained" for name in users)]


@dataclass(frozen=True)
class Pushed:
    """A further point with its pose (3 x 1) and the wrench on it (3 x 1)."""

    name: str
    x: ca.SX
    wrench: ca.SX


def forces_at_points(model: LinkageModel, u: Signals) -> list[Pushed]:
    """The further points, with the wrenches of hands and of virtual couplings."""
    points = []
    for point in model.linkage.point:
        wrench = u[f"{point.name}.F_hand"]
        if (drift := f"{point.name}.F_drift") in u:
            wrench = wrench - u[drift]
        points.append(Pushed(point.name, model.pose(point.body, f"{point.name}.at"), wrench))
    return points


def efforts(model: LinkageModel, u: Signals) -> ca.SX:
    """Sum of J_k' F_k, n x 1."""
    Q = ca.SX(model.q.numel(), 1)
    for point in forces_at_points(model, u):
        Q += ca.jtimes(point.x, model.q, point.wrench, True)
    return Q


def jacobians(model: LinkageModel, names: Users) -> dict[str, ca.SX]:
    """J_k of the points, by name."""
    points = (p for name in names for p in model.linkage.point if p.name == name)
    return {p.name: ca.jacobian(model.pose(p.body, f"{p.name}.at"), model.q) for p in points}


def mobilities(space: OperationalSpace, names: Users) -> dict[str, ca.SX]:
    """Lambda_k^-1 of the points, by output."""
    points = jacobians(space.model, names).items()
    return {f"{name}.Lambda_inv": space.mobility(J) for name, J in points}


def values(
    space: OperationalSpace, block: Block, users: Users, applied: ca.SX, *, mobility: bool
) -> dict[str, ca.SX]:
    """The outputs; `applied` are the generalised forces (n x 1) of all wrenches and contacts."""
    model, outputs = space.model, dict[str, ca.SX]()
    for point in forces_at_points(model, block.u):
        outputs[f"{point.name}.x"], outputs[f"{point.name}.v"] = point.x, model.rate(point.x)
        if mobility:
            outputs |= mobilities(space, (point.name,))
        if point.name in users:
            J = ca.jacobian(point.x, model.q)
            acceleration = J @ space.response(applied - J.T @ point.wrench)[0]
            outputs[f"{point.name}.a_bias"] = space.bias(point.x)
            outputs[f"{point.name}.F_env"] = equivalent_wrench(
                model.linkage.space,
                space.mobility(J),
                space.open_mobility(J),
                acceleration,
                block.p["length_scale"],
            )
    return outputs


def directions(
    block: Block,
    space: OperationalSpace,
    users: Users,
    q0: ca.SX,
    q1: ca.SX,
    points: Points | None = None,
    handles: Handles = MappingProxyType({}),
) -> dict[str, ConstrainedDirections]:
    """The constrained directions at the operational point and at those of users, by state.
    points: of an operational point that changes; handles: of devices that do not render all."""
    moves = block, space, q0, q1
    rendered = {name: rendered_directions(handles.get(name)) for name in ("", *users)}
    constrained = [constrained_directions(*moves, points=points, rendered=rendered[""])]
    for name, J in jacobians(space.model, users).items():
        constrained.append(constrained_directions(*moves, J, f"{name}.", rendered=rendered[name]))
    return dict(zip(counts(users), constrained, strict=True))
