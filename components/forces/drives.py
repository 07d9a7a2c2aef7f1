"""Joint drives, for active linkages (future work in the report's chapter 7):

constant  Q = effort
profile   Q = effort(t), from a table (time_tables.py)
pd        Q = k (target(t) - q) + b (target'(t) - qd)
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.specs.linkage import (
    ConstantDrive,
    Joint,
    Linkage,
    PDDrive,
    ProfileDrive,
)
from hapticlink.components.time_tables import TimeTable

if TYPE_CHECKING:
    from hapticlink.components.linkage.model import LinkageModel


def parameters(linkage: Linkage) -> list[Variable]:
    """The parameters of the drives. Raises ValueError for a drive on a free joint, which has three
    coordinates."""
    found = []
    for j in linkage.joint:
        if j.drive is not None and j.type == "free":
            raise ValueError(
                f"joint `{j.name}`: a drive acts on one coordinate, a free joint has 3"
            )
        rotary, text = j.type == "revolute", f"drive of {j.name}"
        if isinstance(j.drive, ConstantDrive):
            unit = "N.m" if rotary else "N"
            found.append(Variable(f"{j.name}.effort", (), unit, j.drive.effort, text))
        elif isinstance(j.drive, PDDrive):
            units = ("N.m/rad", "N.m.s/rad") if rotary else ("N/m", "N.s/m")
            gains = (j.drive.stiffness, j.drive.damping)
            for name, unit, gain in zip(("K", "B"), units, gains, strict=True):
                found.append(Variable(f"{j.name}.drive_{name}", (), unit, gain, text))
    return found


def energy(model: LinkageModel) -> None:
    """None: a drive stores no energy, it does work on the linkage."""
    return None


def efforts(model: LinkageModel) -> ca.SX | None:
    driven = [j for j in model.linkage.joint if j.drive is not None]
    if not driven:
        return None
    Q, tabled = ca.SX(model.q.numel(), 1), iter(ca.vertsplit(model.tabled, 2))
    for j in driven:
        Q[model.coordinate(j.name)] = _effort(model, j, tabled)
    return Q


def tables(linkage: Linkage) -> list[TimeTable]:
    """The time tables of the drives, in the order of the joints."""
    return [
        TimeTable(j.drive.table, f"{j.name}.drive.table")
        for j in linkage.joint
        if isinstance(j.drive, ProfileDrive | PDDrive)
    ]


def _effort(model: LinkageModel, joint: Joint, tabled: Iterator[ca.SX]) -> ca.SX:
    """The effort of a joint's drive; `tabled` yields (y, y') of the tables in turn, which are NaN
    in a model without an instant t."""
    drive, p = joint.drive, model.p
    if isinstance(drive, ConstantDrive):
        return p[f"{joint.name}.effort"]
    value, rate = ca.vertsplit(next(tabled, ca.SX([math.nan, math.nan])))
    if not isinstance(drive, PDDrive):
        return value
    k = model.coordinate(joint.name)
    return p[f"{joint.name}.drive_K"] * (value - model.q[k]) + p[f"{joint.name}.drive_B"] * (
        rate - model.qd[k]
    )
