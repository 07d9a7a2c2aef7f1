"""The closures h(q) = 0 of a linkage (2.13): cut joints, and gears between joints.

With p_k the loop's point on bodies[k], theta_k the angle of bodies[k], t and n the slot's direction
and its normal, both fixed to bodies[1], and L the mean link length:

    revolute    p_0 - p_1 = 0
    slot        n' (p_0 - p_1) = 0
    prismatic   n' (p_0 - p_1) = 0,   L (theta_0 - theta_1 - angle) = 0
    gear        q_0 - ratio q_1 - offset = 0, times L where q_0 is an angle

All rows are in m, so that multipliers are in N and closures of any kind have comparable errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca

from hapticlink.components.component import Signals, Variable
from hapticlink.components.linkage.parameters import loop_name, mean_link_length
from hapticlink.components.specs.linkage import Gear, Joint, Linkage


class Placed(Protocol):
    """A linkage at coordinates q, with the frames of its bodies: a `LinkageModel`."""

    linkage: Linkage
    p: Signals
    q: ca.SX

    @property
    def frames(self) -> Any: ...

    def coordinate(self, joint: str) -> int: ...


@dataclass(frozen=True)
class Closure:
    """A closure: its name, what it joins, and its rows (m)."""

    name: str
    joins: str
    h: ca.SX


def rows(linkage: Linkage) -> tuple[int, ...]:
    """The number of rows of each closure: loops first, then gears."""
    return (*(loop.kind.rows for loop in linkage.loop), *(1 for _ in linkage.gear))


def gear_name(linkage: Linkage, index: int) -> str:
    return linkage.gear[index].name or f"gear{index + 1}"


def gear_parameters(linkage: Linkage) -> list[Variable]:
    """Ratio and offset of each gear; by default the offset is that of the start coordinates."""
    rows = []
    for i, gear in enumerate(linkage.gear):
        name = gear_name(linkage, i)
        unit, per = (_joint(linkage, joint).kind.units[0] for joint in gear.joints)
        text = f"{gear.joints[0]} over {gear.joints[1]}"
        ratio_unit = "1" if unit == per else f"{unit}/{per}"
        rows.append(Variable(f"{name}.ratio", (), ratio_unit, gear.ratio, text, "fixed"))
        text = f"{gear.joints[0]} where {gear.joints[1]} is 0"
        rows.append(Variable(f"{name}.offset", (), unit, _offset(linkage, gear), text, "fixed"))
    return rows


def _joint(linkage: Linkage, name: str) -> Joint:
    return next(j for j in linkage.joint if j.name == name)


def _offset(linkage: Linkage, gear: Gear) -> float:
    if gear.offset is not None:
        return gear.offset
    first, second = (float(linkage.start.get(joint, 0.0)) for joint in gear.joints)  # type: ignore[arg-type]
    return first - gear.ratio * second


def closures(model: Placed) -> list[Closure]:
    """The closures at the model's pose."""
    linkage = model.linkage
    length = mean_link_length(linkage)
    rows_of_loops = [_loop(model, i, length) for i in range(len(linkage.loop))]
    for i, gear in enumerate(linkage.gear):
        name = gear_name(linkage, i)
        first, second = (model.q[model.coordinate(joint)] for joint in gear.joints)
        turns = _joint(linkage, gear.joints[0]).kind.turns
        h = first - model.p[f"{name}.ratio"] * second - model.p[f"{name}.offset"]
        joins = f"{gear.joints[0]} to {gear.joints[1]}"
        rows_of_loops.append(Closure(name, joins, length * h if turns else h))
    return rows_of_loops


def _loop(model: Placed, index: int, length: float) -> Closure:
    loop, name = model.linkage.loop[index], loop_name(model.linkage, index)
    first, second = (model.frames[body] for body in loop.bodies)
    gap = first.point(model.p[f"{name}.at1"]) - second.point(model.p[f"{name}.at2"])
    if loop.kind.has_axis:
        axis = model.p[f"{name}.axis"]
        across = second.rotation @ ca.vertcat(-ca.sin(axis), ca.cos(axis))
        gap = ca.dot(across, gap)
    if not loop.kind.turns:
        turned = first.angle - second.angle - model.p[f"{name}.angle"]
        gap = ca.vertcat(gap, length * turned)
    return Closure(name, f"{loop.bodies[0]} to {loop.bodies[1]}", gap)
