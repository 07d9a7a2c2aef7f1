"""The grasp: which of a linkage's named points the hand holds, and the clutch between point and
handle.

    x = x_k(q) + c,   v = J_k qd,   path = x_k(q) + s

with k the number of the point that is held, from 1, and offsets c and s, both 0 at the start. Of no
point, k = 0, pose, Jacobian and mobility are 0: the hand's wrench and the coupling act on nothing,
and x and path stand still. A change takes effect when a step begins. The handle is not where the
new point is, so c is taken anew at the grasp: x is then the handle's pose x_D, and the coupling
starts relaxed; without a device x goes on from where it was. s makes path, with which wrenches are
paired for their work, continuous over all changes:

    c <- x_D - x_k(q)  or  x - x_k(q),    s <- path - x_k(q)

Where a device is coupled, the hand lets go for a step at least, and until mobility and directions
that come from the graphics copy are those of the point that is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from hapticlink.components.component import Block, Signals, Variable
from hapticlink.components.dynamics.constrained_directions import Points
from hapticlink.components.linkage.model import LinkageModel, same_point
from hapticlink.components.schematic_parts import BlockPart
from hapticlink.components.specs.linkage import Linkage

POINT = "point"
"""The parameter that chooses."""
ASKED, HELD, READY = "asked_point", "held_point", "ready_point"
"""The numbers of the point that the parameter asks for, that the hand holds, and of which the
graphics copy puts out mobility and directions."""
OFFSET, PATH, HANDLE = "x_offset", "path", "x_handle"
_BEGIN = "path_offset"
CLUTCH = Variable(HELD, (), "1", 1.0, "point that the hand holds, 0 for none")
"""The input of a block that is let go with the point."""


def start(linkage: Linkage) -> int:
    """The number of the point that is held at the start."""
    return linkage.choices.index(linkage.held_name) + 1


def number(linkage: Linkage, name: str, text: str) -> Variable:
    """A signal that is the number of a point. It has no values between its samples."""
    return Variable(name, (), "1", float(start(linkage)), f"{text}, {_list(linkage)}", kind="count")


def _list(linkage: Linkage) -> str:
    return ", ".join(f"{k} {name}" for k, name in enumerate(("none", *linkage.choices)))


def parameters(linkage: Linkage) -> list[Variable]:
    text = f"point that the hand holds, {_list(linkage)}"
    return [Variable(POINT, (), "1", float(start(linkage)), text)]


def inputs(linkage: Linkage, *, coupled: bool, followed: bool) -> list[Variable]:
    """coupled: to a device; followed: by a graphics copy that puts out mobility or directions."""
    handle = Variable(HANDLE, *linkage.space.pose, description="pose of the handle, for a grasp")
    ready = number(linkage, READY, "point of the graphics copy")
    return [*([handle] if coupled else []), *([ready] if followed else [])]


def states(linkage: Linkage) -> list[Variable]:
    pose = linkage.space.pose
    return [Variable(ASKED), Variable(HELD), Variable(OFFSET, *pose), Variable(_BEGIN, *pose)]


def outputs(linkage: Linkage) -> list[Variable]:
    pose = linkage.space.pose
    offset = "offset of x from the pose of the point in the world"
    path = "pose of the point, continuous over changes of it"
    return [
        number(linkage, HELD, "point that the hand holds"),
        number(linkage, ASKED, "point that is asked for"),
        Variable(OFFSET, *pose, description=offset),
        Variable(PATH, *pose, description=path),
    ]


@dataclass(frozen=True)
class Grasp:
    """The grasp of a mechanism: its states at t = 0 and when a step begins, and its outputs."""

    block: Block
    model: LinkageModel

    @property
    def initial(self) -> dict[str, ca.SX]:
        none = ca.SX(self.model.linkage.space.size, 1)
        asked = self.block.p[POINT]
        return {ASKED: asked, HELD: asked, OFFSET: none, _BEGIN: none}

    @property
    def held(self) -> ca.SX:
        """The number of the point that is held over a step."""
        asked, held = self.block.p[POINT], self.block.x[HELD]
        is_granted = ca.SX(1)
        if READY in self.block.u:
            is_granted = same_point(self.block.u[READY], asked)
        if HANDLE in self.block.u:
            is_granted *= ca.logic_or(same_point(held, asked), same_point(held, ca.SX(0)))
        return ca.if_else(is_granted, asked, 0)

    @property
    def changes(self) -> ca.SX:
        """Whether the point changes when a step begins."""
        return ca.logic_not(same_point(self.held, self.block.x[HELD]))

    @property
    def points(self) -> Points:
        return Points(self.block.p[POINT], self.held, self.changes)

    @property
    def begun(self) -> dict[str, ca.SX]:
        """The states when a step begins, which they keep to its end."""
        x, u, after = self.block.x, self.block.u, self.model.pose_of_choice(self.held)
        before = self.model.x_h + x[OFFSET]
        if HANDLE in u:
            before = ca.if_else(same_point(self.held, ca.SX(0)), before, u[HANDLE])
        path = self.model.x_h + x[_BEGIN]
        return {
            ASKED: self.block.p[POINT],
            HELD: self.held,
            OFFSET: ca.if_else(self.changes, before - after, x[OFFSET]),
            _BEGIN: ca.if_else(self.changes, path - after, x[_BEGIN]),
        }

    @property
    def output(self) -> dict[str, ca.SX]:
        x, x_h = self.block.x, self.model.x_h
        named = {ASKED: x[ASKED], HELD: x[HELD], OFFSET: x[OFFSET]}
        return named | {PATH: x_h + x[_BEGIN], "x": x_h + x[OFFSET]}


def inputs_of_copy(linkage: Linkage) -> list[Variable]:
    return [number(linkage, ASKED, "point that is asked for")] if linkage.choices else []


def outputs_of_copy(linkage: Linkage) -> list[Variable]:
    text = "point of mobility and directions"
    return [number(linkage, READY, text)] if linkage.choices else []


def points_of_copy(block: Block) -> Points:
    """The operational point of a graphics copy over a step."""
    asked = block.u[ASKED]
    return Points(asked, asked, ca.logic_not(same_point(asked, block.x[READY])))


def while_held(u: Signals, wrench: ca.SX, otherwise: ca.SX | float = 0.0) -> ca.SX:
    """A wrench on the point that is held, and what stands in its place while none is; the wrench
    itself in a block without a CLUTCH among its inputs u."""
    return ca.if_else(u[HELD] > 0.5, wrench, otherwise) if HELD in u else wrench


def part(block: Block) -> BlockPart:
    """The part of a mechanism by which the hand lets go of a point and holds another."""
    reads = (POINT, *(name for name in (READY, HANDLE) if name in block.u), "q")
    names = [v.name for v in block.outputs]
    given = (_BEGIN, PATH)
    gives = tuple(name for name in given if name in block.x or name in names)
    return BlockPart("point in the hand", r"$x = x_{point}(q) + x_{offset}$", "", reads, gives)
