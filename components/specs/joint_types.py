"""The types of joints, a record each: the relative motions that a joint leaves to its two bodies.

A joint of the tree has a coordinate for each of them; a cut joint, which closes a loop, has a row
of closures for each motion, three in the plane and six in space, that it does not leave. Equations,
units, checks, drawing and exports ask the record, and none of them knows a type by its name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

TreeType = Literal[
    "revolute", "prismatic", "free", "universal", "spherical", "cylindrical", "floating"
]
CutType = Literal["revolute", "slot", "prismatic", "universal", "spherical", "cylindrical", "rod"]
MOTIONS = {2: 3, 3: 6}
"""Those of a rigid body, by the dimension of the plane and of space."""


@dataclass(frozen=True)
class Freedom:
    """A relative motion by one coordinate: of it one body turns, slides, or does both at once."""

    turns: bool
    """Whether the coordinate is the angle by which one body turns relative to the other."""
    along: tuple[int, ...] | Literal["axis"] | None = None
    """Direction of a slide in the frame that guides it, the parent's or that of a cut joint's
    second body: a unit vector, or the joint's own `axis`."""
    name: str = ""
    """Of the coordinate, in a joint of several."""
    about: Literal["axis", "second_axis", "ball"] = "axis"
    """What it turns about: an axis of the joint, or the joint's point, as one of the three
    coordinates of a ball (linkage/rotations.py)."""

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
LENGTH = OwnKey("length", "m", "length")


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
    in_plane: bool = True
    """Whether it is one of planar linkages; others are spatial."""
    in_space: bool = True
    """Whether it is one of spatial linkages."""
    holds: tuple[Literal["point", "line", "distance", "axis", "cross", "frame"], ...] = ()
    """What it holds as a cut joint in space: the first body's point at that of the second, on its
    axis, or at a `length` from it; the axes of both parallel or square, or the frames parallel."""
    axes: int = 0
    """How many axes it has in space."""

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

    def rows(self, dimension: int = 2) -> int:
        """The number of closures as a cut joint: the motions of a body that it does not leave."""
        return MOTIONS[dimension] - self.size

    @property
    def free(self) -> bool:
        """Whether it leaves all motions, and so joins nothing."""
        return not self.rows() if self.in_plane else not self.rows(3)

    @property
    def balls(self) -> tuple[int, ...]:
        """The first coordinate of each ball among its own."""
        return tuple(i for i, f in enumerate(self.freedoms) if f.about == "ball")[:1]

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
        return ("one", "two", "three", "four", "five", "six")[self.size - 1]


_TURN, _SLIDE = Freedom(turns=True, name="theta"), Freedom(turns=False, along="axis", name="s")
_X, _Y = (Freedom(turns=False, along=e, name=n) for e, n in (((1, 0), "x"), ((0, 1), "y")))
_UNIT = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
_SPACE = tuple(Freedom(turns=False, along=e, name=n) for e, n in zip(_UNIT, "xyz", strict=True))
_BALL = tuple(Freedom(turns=True, about="ball", name=f"q_{n}") for n in "xyz")
_SECOND = Freedom(turns=True, about="second_axis", name="second")
_FIVE = (*_BALL, _TURN, _SECOND)
JOINT_TYPES = {
    "revolute": JointType((_TURN,), "pin", holds=("point", "axis"), axes=1),
    "prismatic": JointType(
        (_SLIDE,), "slider", (AXIS,), cut_keys=(ANGLE,), holds=("line", "frame"), axes=1
    ),
    "slot": JointType((_SLIDE, _TURN), "pin", (AXIS,), in_space=False),
    "free": JointType((_X, _Y, _TURN), "", in_space=False),
    "universal": JointType(
        (_TURN, _SECOND), "pin", in_plane=False, holds=("point", "cross"), axes=2
    ),
    "spherical": JointType(_BALL, "pin", in_plane=False, holds=("point",)),
    "cylindrical": JointType(
        (_SLIDE, _TURN), "slider", in_plane=False, holds=("line", "axis"), axes=1
    ),
    "floating": JointType((*_SPACE, *_BALL), "", in_plane=False),
    "rod": JointType(_FIVE, "", (LENGTH,), in_plane=False, holds=("distance",)),
}
