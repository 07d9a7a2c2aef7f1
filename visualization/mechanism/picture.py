"""What is drawn of a frame: poses of the bodies and of the devices' links, directions, forces in
cut joints, and what happens in it. All are CasADi functions of the raw signals, so that a page
without Python evaluates the same, as C."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from hapticlink.analysis.findings.episodes import FULL_TORQUE
from hapticlink.components.device.motors_and_encoders import torque_function
from hapticlink.components.device.workspace import line_function
from hapticlink.components.linkage.poses import pose_function
from hapticlink.components.specs.contacts import Contacts
from hapticlink.components.specs.device import Device
from hapticlink.components.specs.linkage import Linkage
from hapticlink.orchestrator.base.errors import InputFault
from hapticlink.visualization.mechanism.marks import marks, point_of, state

PORT = "user's port"
RAW = ("ghost", "q", "lambda", "P_c", "measured")
"""What frames have instead of what is drawn."""
LEAST_SHARE = 0.05
"""Of a constrained direction in the plane, below which it is a mere turn."""


def require_planar(linkage: Linkage, name: str) -> None:
    """Raises InputFault for a linkage in space, which no page and no replay draws."""
    if linkage.dimension > 2:
        raise InputFault(
            f"{name}: its linkage is in space, and pages and replays draw the plane; the figures "
            "of `hapticlink run` have it at the start and the end"
        )


class Part(NamedTuple):
    """A quantity that is drawn: `function` of the raw signals `needs` of a user, each a vector of
    `sizes`. Its result is a matrix with a column for each of `names`, or for each entry of a list
    without names; of a state, `gives` of `KINDS`, it is 1 while that holds."""

    user: str
    gives: str
    needs: tuple[str, ...]
    sizes: tuple[int, ...]
    function: ca.Function
    names: tuple[str, ...] = ()
    sparse: bool = False
    is_state: bool = False

    def value(self, found: Mapping[str, Any]) -> Any:
        """The quantity of a frame, in a JSON type."""
        given = zip(self.needs, self.sizes, strict=True)
        columns = np.asarray(self.function(*(found[name][:size] for name, size in given))).T
        if self.is_state:
            return bool(columns[0, 0])
        entries = [c.tolist() if np.isfinite(c).all() else None for c in columns]
        entries = [e for e in entries if e is None or any(e)] if self.sparse else entries
        return dict(zip(self.names, entries, strict=True)) if self.names else entries


class Picture:
    """The picture of a scene, of `marks`; devices: by user, the first one's name is empty. `parts`
    is what is computed of the raw signals."""

    def __init__(
        self,
        linkage: Linkage,
        devices: Mapping[str, Device],
        contacts: Contacts | None,
    ) -> None:
        self.marks = marks(linkage, contacts, devices)
        self._linkage, self._users = linkage, [*devices]
        names, poses = pose_function(linkage)
        n = poses.size1_in(0)
        self.parts = [
            Part("", gives, (q,), (n,), poses, tuple(names))
            for gives, q in (("poses", "q"), ("ghost", "ghost"))
        ]
        if linkage.loop:
            self.parts.append(_cut_joint_forces(linkage, names, poses))
        ok, margin, gap = (ca.SX.sym(name) for name in ("branch_ok", "margin", "gap"))
        space, force = linkage.space, ca.SX.sym("F_env", linkage.space.size)
        touching = ca.logic_and(gap < 0, ca.norm_1(force) > 0)
        self.parts.append(_state("", "folded", {"branch_ok": ok}, ok == 0))
        for user in dict.fromkeys(("", *(point.name for point in linkage.point))):
            self.parts.append(
                Part(user, "directions", ("P_c",), (space.size**2,), directions(), sparse=True)
            )
            self.parts.append(_state(user, "outside", {"margin": margin}, margin < 0))
            self.parts.append(_state(user, "contacts", {"gap": gap, "F_env": force}, touching))
        for user, device in devices.items():
            self.parts.append(
                Part(user, "arms", ("handle",), device.space.pose.shape, line_function(device))
            )
            self.parts.append(_is_saturated(user, device))

    def drawn(self, frame: dict[str, Any]) -> dict[str, Any]:
        """The frame with `poses`, `ghost` by body's name, forces in the `cut` joints, `states`, and
        of each user `arms` of the device and the constrained `directions` in the plane, in place of
        coordinates, multipliers and projector."""
        others = frame.get("others", {})
        shown = _without_raw(frame)
        if others:
            shown["others"] = {user: _without_raw(found) for user, found in others.items()}
        states = []
        for part in self.parts:
            found = others.get(part.user, {}) if part.user else frame
            if not {*part.needs} <= {*found}:
                continue
            value = part.value(found)
            if part.is_state:
                states += [state(part.gives, part.user)] if value else []
            else:
                (shown["others"][part.user] if part.user else shown)[part.gives] = value
        return shown | {"states": states}

    def at_rest(self, q: Any) -> dict[str, Any]:
        """A frame of the linkage at joint coordinates q, with each device at its user's point."""
        frame = self.drawn({"q": q})
        arms = {part.user: part for part in self.parts if part.gives == "arms"}
        for user in self._users:
            (_, body), (px, py) = point_of(self._linkage, user)
            x, y, angle = frame["poses"][body]
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            pose = [*(np.array([x, y]) + turn @ (px, py)), angle]
            drawn = arms[user].value({"handle": pose})
            (frame.setdefault("others", {}).setdefault(user, {}) if user else frame)["arms"] = drawn
        return frame


def _without_raw(values: Mapping[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in values.items() if k not in RAW}


def _cut_joint_forces(linkage: Linkage, names: list[str], poses: ca.Function) -> Part:
    """The force (N) in each joint that is cut, (2, k). It has two multipliers, a slot one; that of
    what slides is along the normal, and a moment has no arrow."""
    rows = sum(loop.kind.rows() for loop in linkage.loop)
    along, q = ca.SX.sym("lambda", rows), ca.SX.sym("q", poses.size1_in(0))
    angles, forces, row = poses(q)[2, :], [], 0
    for loop in linkage.loop:
        normal = angles[names.index(loop.bodies[1])] + (loop.axis or 0.0)
        force = along[row] * ca.vertcat(-ca.sin(normal), ca.cos(normal))
        forces.append(force if loop.kind.has_axis else along[row : row + 2])
        row += loop.kind.rows()
    made = ca.Function("cut", [along, q], [ca.horzcat(*forces)])
    return Part("", "cut", ("lambda", "q"), (rows, q.numel()), made)


def directions() -> ca.Function:
    """The constrained directions in the plane, (2, 2): unit vectors (x, y) times their share of the
    scaled direction (x, y, L theta), which span the projector P_c, (9,); zeros in place of those
    that are none, or a mere turn.

    With an orthonormal basis V (3, r) of its range P_c = V V', so that those with the main axes in
    the plane are the eigenvectors of the first two rows and columns of P_c times the roots of their
    eigenvalues, whatever the rank r.
    """
    p = ca.SX.sym("P_c", 9)
    a, b, d = p[0], p[1], p[4]
    mean, apart, angle = (a + d) / 2, ca.hypot((a - d) / 2, b), ca.atan2(2 * b, a - d) / 2
    axes = ca.vertcat(ca.cos(angle), ca.sin(angle)), ca.vertcat(-ca.sin(angle), ca.cos(angle))
    shares = (ca.sqrt(ca.fmax(mean + apart, 0)), ca.sqrt(ca.fmax(mean - apart, 0)))
    shown = [
        ca.if_else(share > LEAST_SHARE, share, 0) * axis
        for share, axis in zip(shares, axes, strict=True)
    ]
    return ca.Function("directions", [p], [ca.horzcat(*shown)])


def _state(user: str, kind: str, needs: Mapping[str, ca.SX], holds: ca.SX) -> Part:
    """A state that `holds` or not by the signals that it needs."""
    function = ca.Function(kind, [*needs.values()], [holds])
    sizes = tuple(symbol.numel() for symbol in needs.values())
    return Part(user, kind, (*needs,), sizes, function, is_state=True)


def _is_saturated(user: str, device: Device) -> Part:
    """Whether a motor gives its largest torque."""
    force, pose = (ca.SX.sym(name, device.space.size) for name in ("F_motor", "measured"))
    limits = ca.DM([motor.torque_limit for motor in device.motors])
    loads = ca.norm_inf(torque_function(device)(force, pose) / limits)
    return _state(user, "saturated", {"F_motor": force, "measured": pose}, loads >= FULL_TORQUE)
