"""Joint drives, for active linkages (future work in the report's chapter 7):

constant  Q = effort
profile   Q = effort(t), from a table, spline or sine (components/paths)
pd        Q = k (target(t) - c) + b (target'(t) - c')

on the coordinate c of a joint (joint_coordinates.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import casadi as ca

from hapticlink.components.component import Variable
from hapticlink.components.linkage.joint_coordinates import JointCoordinate, joints_with
from hapticlink.components.linkage.model import LinkageModel
from hapticlink.components.paths import signal
from hapticlink.components.specs.drives import ConstantDrive, PDDrive, ProfileDrive
from hapticlink.components.specs.linkage import Linkage
from hapticlink.components.time_signals import TimeSignal


def parameters(linkage: Linkage) -> list[Variable]:
    """The parameters of the drives. Raises ValueError for a drive on a free joint, which has three
    coordinates."""
    variables = []
    for j in joints_with(linkage, "drive"):
        drive, text = j.joint.drive, f"drive of {j.name}"
        if isinstance(drive, ConstantDrive):
            variables.append(Variable(f"{j.name}.effort", (), j.effort_unit, drive.effort, text))
        elif isinstance(drive, PDDrive):
            units = (f"{j.effort_unit}/{j.unit}", f"{j.effort_unit}.s/{j.unit}")
            gains = (drive.stiffness, drive.damping)
            for name, unit, gain in zip(("K", "B"), units, gains, strict=True):
                variables.append(Variable(f"{j.name}.drive_{name}", (), unit, gain, text))
    return variables


def energy(model: LinkageModel) -> None:
    """None: a drive stores no energy, it does work on the linkage."""
    return None


def efforts(model: LinkageModel) -> ca.SX | None:
    driven = joints_with(model.linkage, "drive")
    Q, tabled = ca.SX(model.q.numel(), 1), iter(ca.vertsplit(model.tabled, 2))
    for j in driven:
        c = j.value(model)
        Q += ca.jacobian(c, model.q).T * _effort(model, j, c, tabled)
    return Q if driven else None


def signals(linkage: Linkage) -> list[TimeSignal]:
    """The signals of the drives over time, in the order of the joints."""
    return [
        signal(drive.table, drive.interpolation, f"{j.name}.drive.table")
        for j in joints_with(linkage, "drive")
        if isinstance(drive := j.joint.drive, ProfileDrive | PDDrive)
    ]


def _effort(
    model: LinkageModel, joint: JointCoordinate, c: ca.SX, tabled: Iterator[ca.SX]
) -> ca.SX:
    """The effort of a joint's drive at its coordinate c; `tabled` yields (y, y') of the signals in
    turn, which are NaN in a model without an instant t."""
    drive, p = joint.joint.drive, model.p
    if isinstance(drive, ConstantDrive):
        return p[f"{joint.name}.effort"]
    value, rate = ca.vertsplit(next(tabled, ca.SX([math.nan, math.nan])))
    if not isinstance(drive, PDDrive):
        return value
    K, B = p[f"{joint.name}.drive_K"], p[f"{joint.name}.drive_B"]
    return K * (value - c) + B * (rate - model.rate(c))
