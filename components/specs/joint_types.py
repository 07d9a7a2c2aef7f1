"""The types of joints, a record each: the relative motions that a joint leaves to its two bodies.

A joint of the tree has a coordinate for each of them; a cut joint, which closes a loop, has a row
of closures for each motion of the plane that it does not leave. Equations, units, checks, drawing
and exports ask the record, and none of them knows a type by its name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

TreeType = Literal["revolute", "prismatic", "free"]
CutType = Literal["revolute", "slot", "prismatic"]


@dataclass(frozen=True)
class Freedom:
    """A relative motion by one coordinate: of it one body turns, slides, or does both at once."""

    turns: bool
    """Whether the coordinate is the angle by which one body turns relative to the other."""
    along: tuple[int, int] | Literal["axis"] | None = None
    """Direction of a slide in the frame that guides it, the parent's or that of a cut joint's
    second body: a unit vector, or the joint's own `axis`."""
    name: str = ""
    """Of the coordinate, in a joint of several."""

    @property
    def slides(self) -> bool:
        """Whether one body's point leaves that of the other."""
        return self.along is not None

    @property
    def pure(self) -> bool:
        """Whether it is a turn or a slide alone, which is all that MuJoCo and others know."""
        return self.turns != self.slides

    @property
    def unit(self) -> Literal["rad", "m"]:
        return "rad" if self.turns else "m"

    @property
    def rate_unit(self) -> str:
        return f"{self.unit}/s"

    @property
    def effort_unit(self) -> str:
        return "N.m" if self.turns else "N"


@dataclass(frozen=True)
class OwnKey:
    """A key that joints of some types have, as the scene names it: a parameter of the FMU. One that
    is not `required` is 0 by default."""

    name: str
    unit: str
    what: str
    required: bool = True


AXIS = OwnKey("axis", "rad", "direction")
ANGLE = OwnKey("angle", "rad", "angle", required=False)


@dataclass(frozen=True)
class JointType:
    """What all that deals with joints has to know of one."""

    freedoms: tuple[Freedom, ...]
    mark: Literal["pin", "slider", ""]
    """How a joint of the tree is drawn."""
    keys: tuple[OwnKey, ...] = ()
    """Those that it has beside the keys of all joints."""
    cut_keys: tuple[OwnKey, ...] = ()
    """Further ones that it has as a cut joint."""

    def own_keys(self, cut: bool) -> tuple[OwnKey, ...]:
        return self.keys + self.cut_keys * cut

    @property
    def freedom(self) -> Freedom:
        """The one of a joint of one coordinate; of a cut joint that on which springs, friction,
        limits and drives act."""
        return self.freedoms[0]

    @property
    def size(self) -> int:
        """The number of coordinates."""
        return len(self.freedoms)

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(freedom.unit for freedom in self.freedoms)

    @property
    def rows(self) -> int:
        """The number of closures as a cut joint: of the three motions of the plane, those that it
        does not leave."""
        return 3 - self.size

    @property
    def free(self) -> bool:
        """Whether it leaves all motions of the plane, and so joins nothing."""
        return not self.rows

    @property
    def has_axis(self) -> bool:
        """Whether it slides along an `axis` of its own."""
        return AXIS in self.keys

    @property
    def turns(self) -> bool:
        """Whether one body turns relative to the other."""
        return any(freedom.turns for freedom in self.freedoms)

    @property
    def slides(self) -> bool:
        """Whether one body's point leaves that of the other."""
        return any(freedom.slides for freedom in self.freedoms)

    @property
    def count(self) -> str:
        """The number of coordinates, in words."""
        return ("one", "two", "three")[self.size - 1]


_TURN, _SLIDE = Freedom(turns=True, name="theta"), Freedom(turns=False, along="axis", name="s")
_X, _Y = (Freedom(turns=False, along=e, name=n) for e, n in (((1, 0), "x"), ((0, 1), "y")))
JOINT_TYPES = {
    "revolute": JointType((_TURN,), "pin"),
    "prismatic": JointType((_SLIDE,), "slider", (AXIS,), cut_keys=(ANGLE,)),
    "slot": JointType((_SLIDE, _TURN), "pin", (AXIS,)),
    "free": JointType((_X, _Y, _TURN), ""),
}
