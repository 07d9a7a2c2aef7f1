"""Joints as ports: a motor or controller outside of the mechanism drives a joint, and measures it.

    Q_k += effort_k,   position_k = q_k,   velocity_k = qd_k

for the coordinates k of joints with `ports`.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from hapticlink.components.component import Signals, Variable
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.ports import Power
from hapticlink.components.specs.linkage import Joint, Linkage


def _of(linkage: Linkage, port: str) -> Iterator[tuple[Joint, str]]:
    """The joints with a port, and the name of its variable. Raises ValueError for a joint of
    several coordinates."""
    for joint in linkage.joint:
        if port not in joint.ports:
            continue
        if joint.kind.size > 1:
            raise ValueError(
                f"joint `{joint.name}`: ports are of one coordinate, a {joint.type} joint has "
                f"{joint.kind.size}"
            )
        yield joint, f"{joint.name}.{port}"


def inputs(linkage: Linkage) -> list[Variable]:
    """An effort (N.m or N) for each joint with this port; it carries power where the joint's
    position is an output, too."""
    rows = []
    for joint, name in _of(linkage, "effort"):
        power = Power(f"{joint.name}.position") if "position" in joint.ports else None
        text = f"effort on {joint.name} from outside"
        rows.append(
            Variable(name, (), joint.kind.freedom.effort_unit, description=text, power=power)
        )
    return rows


def outputs(linkage: Linkage) -> list[Variable]:
    """Position (rad or m) and velocity (rad/s or m/s) of the joints with these ports."""
    rows = [
        Variable(name, (), j.kind.freedom.unit, description=f"coordinate of {j.name}")
        for j, name in _of(linkage, "position")
    ]
    for joint, name in _of(linkage, "velocity"):
        of = f"{joint.name}.position" if "position" in joint.ports else None
        text = f"rate of {joint.name}"
        rows.append(
            Variable(name, (), joint.kind.freedom.rate_unit, description=text, derivative_of=of)
        )
    return rows


def efforts(model: LinkageModel, u: Signals) -> ca.SX:
    """The efforts from outside, n x 1."""
    Q = ca.SX(model.q.numel(), 1)
    for joint, name in _of(model.linkage, "effort"):
        Q[model.coordinate(joint.name)] += u[name]
    return Q


def values(model: LinkageModel) -> dict[str, ca.SX]:
    """The values of the outputs."""
    positions = {n: model.q[model.coordinate(j.name)] for j, n in _of(model.linkage, "position")}
    rates = {n: model.qd[model.coordinate(j.name)] for j, n in _of(model.linkage, "velocity")}
    return positions | rates
