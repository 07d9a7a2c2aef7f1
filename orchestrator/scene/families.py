"""Linkages that repeat a pattern: `family` and `n` of [linkage] become its bodies, joints, loops.

The other keys of the table are merged over those of the family.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from hapticlink.components.registry import Registry, no_function
from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.specs.quantities import Quantity
from hapticlink.orchestrator.scene.toml_keys import Path

ARGUMENTS = ("family", "n")
MEMBERS = Quantity("1", ge=1, le=1000)


@dataclass(frozen=True, kw_only=True)
class FamilyLinkage(Linkage):
    """Bodies, a tree of joints, and the cut joints that close loops; or a family of linkages, over
    which the other keys are merged."""

    family: Annotated[str, FAMILIES.names()] | None = None
    """A linkage that repeats a pattern: n-four-bar."""
    n: Annotated[int, MEMBERS] | None = None
    """Number of repetitions of the pattern."""


class FamilyError(ValueError):
    """An invalid `family` or `n`: its path in the file, and a message."""

    def __init__(self, key: str, message: str) -> None:
        self.path: Path = ("linkage", key)
        self.message = message
        super().__init__(message)


def n_four_bar(n: int) -> dict[str, Any]:
    """The tables of n square windows in a row: 2n + 1 uniform rods of 1 m and 1 kg. At the start
    the rockers are upright and the tip of the first one (B0) moves at 1 m/s in x.

    Problem A02 of the IFToMM library of computational benchmark problems.
    """
    rod = {"mass": 1.0, "inertia": 1 / 12, "center": [0.5, 0.0]}
    rockers = [{"name": f"rocker{i}", **rod} for i in range(n + 1)]
    couplers = [{"name": f"coupler{i}", **rod} for i in range(n)]
    pivots = [
        {"name": f"pivot{i}", "child": f"rocker{i}", "at_parent": [float(i), 0.0]}
        for i in range(n + 1)
    ]
    tips = [
        {
            "name": f"tip{i}",
            "parent": f"rocker{i}",
            "child": f"coupler{i}",
            "at_parent": [1.0, 0.0],
        }
        for i in range(n)
    ]
    loops = [
        {
            "name": f"window{i}",
            "bodies": [f"coupler{i}", f"rocker{i + 1}"],
            "at": [[1.0, 0.0], [1.0, 0.0]],
        }
        for i in range(n)
    ]
    upright = {joint["name"]: math.pi / 2 for joint in pivots}
    level = {joint["name"]: -math.pi / 2 for joint in tips}
    return {
        "body": rockers + couplers,
        "joint": pivots + tips,
        "loop": loops,
        "operational_point": {"body": "rocker0", "at": [1.0, 0.0]},
        "start": upright | level,
        "start_velocity": dict.fromkeys(upright, -1.0) | dict.fromkeys(level, 1.0),
    }


FAMILIES: Registry[Callable[[int], dict[str, Any]]] = Registry(
    "family", {"n-four-bar": n_four_bar}, no_function
)


def members(arguments: dict[str, Any]) -> dict[str, Any]:
    """The tables of the linkage that `family` and `n` select. Raises FamilyError for an unknown
    family, or an `n` that is no whole number within its range."""
    family, n = str(arguments.get("family")), arguments.get("n")
    if family not in FAMILIES:
        raise FamilyError("family", FAMILIES.unknown(family))
    if not isinstance(n, int) or isinstance(n, bool) or n not in MEMBERS:
        raise FamilyError("n", f"{n!r} is out of range: give a whole number {MEMBERS.range}")
    tables = FAMILIES[family](n)
    if not isinstance(tables, dict):
        raise FamilyError("family", f"{family} gives {tables!r} for n = {n}, no tables")
    return tables


def is_argument(names: Path) -> bool:
    return len(names) == 2 and names[0] == "linkage" and names[1] in ARGUMENTS
