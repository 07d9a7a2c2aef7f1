"""Units and ranges of the numbers in a scene, declared with the keys of its records.

A number of a record has one of the types below or a `Quantity` of its own; the docstring under a
field is the meaning of its key. Values out of range are refused when a scene is read; the reference
page and the JSON schema of scenes are generated from the same declarations.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from dataclasses import KW_ONLY, dataclass
from fractions import Fraction
from typing import Annotated, Any

from annotated_types import Ge, GroupedMetadata, Gt, Le, Lt

_BOUNDS: dict[str, tuple[str, Callable[[Any, Any], bool], Any]] = {
    "gt": (">", operator.gt, Gt),
    "ge": (">=", operator.ge, Ge),
    "lt": ("<", operator.lt, Lt),
    "le": ("<=", operator.le, Le),
}


@dataclass(frozen=True)
class Quantity(GroupedMetadata):
    """A finite number in `unit` ("1" for none), within the bounds that are given."""

    unit: str
    _: KW_ONLY
    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None

    @property
    def bounds(self) -> dict[str, float]:
        """The given bounds by their names, "gt", "ge", "lt" and "le"."""
        given = {name: getattr(self, name) for name in _BOUNDS}
        return {name: bound for name, bound in given.items() if bound is not None}

    @property
    def range(self) -> str:
        """The bounds as text, `> 0 and <= 1000`; `finite` without bounds."""
        bounds = [f"{_BOUNDS[name][0]} {bound}" for name, bound in self.bounds.items()]
        return " and ".join(bounds) or "finite"

    def __contains__(self, number: float | Fraction) -> bool:
        return all(_BOUNDS[name][1](number, bound) for name, bound in self.bounds.items())

    def __iter__(self) -> Iterator[Any]:
        """The bounds as annotations for pydantic."""
        for name, bound in self.bounds.items():
            yield _BOUNDS[name][2](bound)


Time = Annotated[float, Quantity("s")]
Elapsed = Annotated[float, Quantity("s", ge=0, le=100000)]
Duration = Annotated[float, Quantity("s", gt=0, le=1000000000)]
Position = Annotated[float, Quantity("m")]
Length = Annotated[float, Quantity("m", gt=0)]
Angle = Annotated[float, Quantity("rad")]
Coordinate = Annotated[float, Quantity("rad or m")]
Mass = Annotated[float, Quantity("kg", ge=0)]
MomentOfInertia = Annotated[float, Quantity("kg.m2", ge=0)]
ProductOfInertia = Annotated[float, Quantity("kg.m2")]
Force = Annotated[float, Quantity("N")]
Torque = Annotated[float, Quantity("N.m")]
Effort = Annotated[float, Quantity("N.m or N")]
LinearStiffness = Annotated[float, Quantity("N/m", ge=0)]
LinearDamping = Annotated[float, Quantity("N.s/m", ge=0)]
AngularStiffness = Annotated[float, Quantity("N.m/rad", ge=0)]
AngularDamping = Annotated[float, Quantity("N.m.s/rad", ge=0)]
JointStiffness = Annotated[float, Quantity("N.m/rad or N/m", ge=0)]
JointDamping = Annotated[float, Quantity("N.m.s/rad or N.s/m", ge=0)]
Substeps = Annotated[int, Quantity("1", ge=1, le=1000)]
Seed = Annotated[int, Quantity("1", ge=0, le=2**63 - 1)]

Point = tuple[Position, Position]
PointInSpace = tuple[Position, Position, Position]
Place = Point | PointInSpace
"""Of a body, in the plane or in space; without a third number it is in the plane z = 0."""
_Entry = Annotated[float, Quantity("1")]
Direction = tuple[_Entry, _Entry, _Entry]
Pose = tuple[Position, Position, Angle]
Wrench = tuple[Force, Force, Torque]
Stiffness = tuple[LinearStiffness, LinearStiffness, AngularStiffness]
Damping = tuple[LinearDamping, LinearDamping, AngularDamping]
Inertia = tuple[
    Annotated[float, Quantity("kg", gt=0)],
    Annotated[float, Quantity("kg", gt=0)],
    Annotated[float, Quantity("kg.m2", gt=0)],
]


def in_plane(place: Place | None) -> Point:
    """A point of a planar linkage, by default the origin."""
    return (0.0, 0.0) if place is None else (place[0], place[1])
