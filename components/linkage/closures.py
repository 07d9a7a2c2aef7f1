"""The closures h(q) = 0 of a linkage (2.13): cut joints, and gears between joints.

With p_k the loop's point on bodies[k], theta_k the angle of bodies[k], t and n the slot's direction
and its normal, both fixed to bodies[1], and L the mean link length, in the plane:

    revolute    p_0 - p_1 = 0
    slot        n' (p_0 - p_1) = 0
    prismatic   n' (p_0 - p_1) = 0,   L (theta_0 - theta_1 - angle) = 0
    gear        q_0 - ratio q_1 - offset = 0, times L where q_0 is an angle

In space, with a_k the axis of bodies[k], t and n two normals of a_1 and R_k the rotation matrix of
bodies[k], a cut joint holds some of

    point       p_0 - p_1 = 0
    line        t' (p_0 - p_1) = 0,   n' (p_0 - p_1) = 0
    distance    (|p_0 - p_1|^2 - length^2)/(2 length) = 0
    axis        L t' a_0 = 0,   L n' a_0 = 0
    cross       L a_0' a_1 = 0
    frame       L/2 (the three differences of R_1' R_0 across its diagonal) = 0

(Featherstone, Rigid Body Dynamics Algorithms, 2008, section 8.2, for the constraint forces that
they are dual to.) All rows are in m, so that multipliers are in N and closures of any kind have
comparable errors. In space a row that no coordinate moves is left out of h; its gap is constant.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca

from hapticlink.components.component import Signals, Variable
from hapticlink.components.linkage.frame import Frame
from hapticlink.components.linkage.parameters import loop_name, mean_link_length
from hapticlink.components.linkage.rotations import Z_AXIS, Axis, normals, unit
from hapticlink.components.specs.linkage import Gear, Joint, Linkage


class Placed(Protocol):
    """A linkage at coordinates q, with the frames of its bodies: a `LinkageModel`."""

    linkage: Linkage
    p: Signals
    q: ca.SX
    d: int

    @property
    def frames(self) -> Any: ...

    def at(self, body: str, point: str) -> ca.SX: ...

    def coordinate(self, joint: str) -> int: ...


@dataclass(frozen=True)
class Closure:
    """A closure: its name, what it joins, its rows (m), and those that no coordinate moves."""

    name: str
    joins: str
    h: ca.SX
    constant: ca.SX


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
        rows_of_loops.append(Closure(name, joins, length * h if turns else h, ca.SX(0, 1)))
    return rows_of_loops


def _loop(model: Placed, index: int, length: float) -> Closure:
    loop, name = model.linkage.loop[index], loop_name(model.linkage, index)
    first, second = (model.frames[body] for body in loop.bodies)
    gap = model.at(loop.bodies[0], f"{name}.at1") - model.at(loop.bodies[1], f"{name}.at2")
    joins = f"{loop.bodies[0]} to {loop.bodies[1]}"
    if model.d > 2:
        held = _HELD_IN_SPACE
        own, other = map(unit, loop.axes or (Z_AXIS, Z_AXIS))
        rod = model.p.get(f"{name}.length", ca.SX(0))
        ends = _Ends(gap, first, second, own, other, length, rod)
        rows = ca.vertcat(*(held[what](ends) for what in loop.kind.holds))
        return _moved(model, name, joins, rows)
    if loop.kind.has_axis:
        axis = model.p[f"{name}.axis"]
        across = second.rotation @ ca.vertcat(-ca.sin(axis), ca.cos(axis))
        gap = ca.dot(across, gap)
    if not loop.kind.turns:
        turned = first.angle - second.angle - model.p[f"{name}.angle"]
        gap = ca.vertcat(gap, length * turned)
    return Closure(name, joins, gap, ca.SX(0, 1))


@dataclass(frozen=True)
class _Ends:
    """The two ends of a cut joint in space: the gap from the second to the first, their frames and
    axes, L, and the length of a rod."""

    gap: ca.SX
    first: Frame
    second: Frame
    first_axis: Axis
    second_axis: Axis
    scale: float
    length: ca.SX

    @property
    def across(self) -> ca.SX:
        """(t n)', 2 x 3."""
        return ca.horzcat(*(self.second.direction(n) for n in normals(self.second_axis))).T

    @property
    def turned(self) -> ca.SX:
        """The three differences of the relative rotation across its diagonal, halved."""
        R = self.second.rotation.T @ self.first.rotation
        return ca.inv_skew(R - R.T) / 2


_HELD_IN_SPACE: dict[str, Callable[[_Ends], ca.SX]] = {
    "point": lambda ends: ends.gap,
    "line": lambda ends: ends.across @ ends.gap,
    "distance": lambda ends: (ca.dot(ends.gap, ends.gap) - ends.length**2) / (2 * ends.length),
    "axis": lambda ends: ends.scale * ends.across @ ends.first.direction(ends.first_axis),
    "cross": lambda ends: (
        ends.scale
        * ca.dot(ends.first.direction(ends.first_axis), ends.second.direction(ends.second_axis))
    ),
    "frame": lambda ends: ends.scale * ends.turned,
}


def _moved(model: Placed, name: str, joins: str, rows: ca.SX) -> Closure:
    """The closure of these rows, those that no coordinate moves apart."""
    rows = ca.densify(rows)
    moves = ca.which_depends(rows, model.q, 1, True)
    parts = [[i for i, m in enumerate(moves) if m == moved] for moved in (True, False)]
    return Closure(name, joins, *(rows[part] if part else ca.SX(0, 1) for part in parts))
